#include "tools/common/command_line.h"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <iostream>
#include <optional>
#include <sstream>

#include "common/error.h"
#include "datasets/text_parsing.h"

namespace livemap::tools {
namespace {

[[noreturn]] void RefuseFlagNumber(const std::string& flag, const std::string& text,
                                   const char* kind, double min, double max) {
  std::ostringstream sentence;
  sentence << "--" << flag << " is '" << text << "', accepted is " << kind << " from " << min
           << " to " << max;
  throw Error(sentence.str());
}

}  // namespace

CommandLine::CommandLine(std::string usage, std::string about, std::size_t positionals,
                         std::vector<Flag> flags)
    : usage_(std::move(usage)),
      about_(std::move(about)),
      wanted_positionals_(positionals),
      flags_(std::move(flags)) {}

const Flag* CommandLine::Find(const std::string& name) const {
  for (const Flag& flag : flags_) {
    if (flag.name == name) return &flag;
  }
  return nullptr;
}

bool CommandLine::Parse(int argc, char** argv) {
  const auto is_known_flag = [this](const std::string& argument) {
    if (argument.compare(0, 2, "--") != 0) return false;
    const std::string name = argument.substr(2, argument.find('=') - 2);
    return name == "help" || Find(name) != nullptr;
  };
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--help" || argument == "-h") {
      PrintHelp();
      return false;
    }
    if (argument.compare(0, 2, "--") != 0) {
      if (argument.size() > 1 && argument[0] == '-') {
        throw Error("the flag '" + argument + "' is unknown, see --help");
      }
      positionals_.push_back(argument);
      continue;
    }
    const std::size_t equals = argument.find('=');
    const std::string name = argument.substr(2, equals == std::string::npos ? equals : equals - 2);
    const Flag* const flag = Find(name);
    if (flag == nullptr) throw Error("the flag '--" + name + "' is unknown, see --help");
    if (Has(name)) throw Error("the flag '--" + name + "' is given twice");
    if (flag->value.empty() && equals != std::string::npos) {
      throw Error("the flag '--" + name + "' takes no value");
    }
    if (flag->value.empty()) {
      values_[name] = "";
    } else if (equals != std::string::npos) {
      values_[name] = argument.substr(equals + 1);
    } else if (i + 1 < argc && !is_known_flag(argv[i + 1])) {
      values_[name] = argv[++i];
    } else {
      throw Error("the flag '--" + name + "' needs a value: " + flag->value);
    }
    if (!flag->value.empty() && values_[name].empty()) {
      throw Error("--" + name + " is '', accepted is " + flag->value);
    }
  }
  const bool as_wanted = wanted_positionals_ == kOneOrMore
                             ? !positionals_.empty()
                             : positionals_.size() == wanted_positionals_;
  if (!as_wanted) {
    throw Error("got " + std::to_string(positionals_.size()) + " arguments, usage is: " + usage_);
  }
  return true;
}

void CommandLine::PrintHelp() const {
  std::printf("usage: %s\n\n%s\n\n", usage_.c_str(), about_.c_str());
  for (const Flag& flag : flags_) {
    const std::string head = "--" + flag.name + (flag.value.empty() ? "" : " " + flag.value);
    std::printf("  %-30s %s\n", head.c_str(), flag.help.c_str());
  }
  std::printf("  %-30s %s\n", "--help", "show this and exit");
}

std::string CommandLine::Text(const std::string& flag, const std::string& otherwise) const {
  const auto found = values_.find(flag);
  return found == values_.end() ? otherwise : found->second;
}

double CommandLine::Number(const std::string& flag, double otherwise, double min,
                           double max) const {
  const auto found = values_.find(flag);
  if (found == values_.end()) return otherwise;
  const std::optional<double> value = datasets::ParseFinite(found->second);
  if (!value || *value < min || *value > max) {
    RefuseFlagNumber(flag, found->second, "a number", min, max);
  }
  return *value;
}

int CommandLine::Whole(const std::string& flag, int otherwise, int min, int max) const {
  const auto found = values_.find(flag);
  if (found == values_.end()) return otherwise;
  const std::optional<double> value = datasets::ParseFinite(found->second);
  if (!value || *value < min || *value > max || *value != std::floor(*value)) {
    RefuseFlagNumber(flag, found->second, "a whole number", min, max);
  }
  return static_cast<int>(*value);
}

void CommandLine::CheckNeeds(const std::vector<FlagNeed>& needs) const {
  for (const FlagNeed& need : needs) {
    if (Has(need.flag) && !need.holds) throw Error("--" + need.flag + " needs " + need.need);
  }
}

std::uint64_t CommandLine::Seed(const std::string& flag, std::uint64_t otherwise) const {
  const auto found = values_.find(flag);
  if (found == values_.end()) return otherwise;
  std::uint64_t value = 0;
  const std::string& text = found->second;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw Error("--" + flag + " is '" + text + "', accepted is a whole number from 0 to 2^64 - 1");
  }
  return value;
}

void SayNothingMeasured(const char* name, const std::string& reason) {
  std::fprintf(stderr, "%s: nothing was measured: %s\n", name, reason.c_str());
}

void SayNotes(const char* name, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) std::fprintf(stderr, "%s: %s\n", name, note.c_str());
}

int RunProgram(const char* name, int argc, char** argv, int (*body)(int, char**)) {
  try {
    const int status = body(argc, argv);
    // A full disk shows only now; half a line of JSON must not look like success.
    if (std::cout.flush() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return status;
    std::fprintf(stderr, "%s: what it prints cannot be written\n", name);
    return 1;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return 2;
  } catch (const std::exception& exception) {
    std::fprintf(stderr, "%s: failed: %s\n", name, exception.what());
    return 1;
  }
}

}  // namespace livemap::tools
