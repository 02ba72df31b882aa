#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace livemap::tools {

/// A flag of a command-line program: "--name VALUE", or "--name" alone when `value` is empty.
struct Flag {
  std::string name;   ///< Without the dashes.
  std::string value;  ///< What stands for the value in the help, e.g. "SECONDS".
  std::string help;   ///< One line, with unit and default.
};

/// What a flag tells nothing without.
struct FlagNeed {
  std::string flag;    ///< Without the dashes.
  bool holds = false;  ///< What it needs is so.
  std::string need;    ///< In words, for the refusal: "--FLAG needs NEED".
};

/// The arguments of a program. Every mistake is an Error of one sentence.
class CommandLine {
 public:
  static constexpr std::size_t kOneOrMore = ~std::size_t{0};

  /// `usage` is the line after "usage: "; `about` one or more sentences; exactly `positionals`
  /// arguments without dashes are wanted, or kOneOrMore. "--help" is known by itself.
  CommandLine(std::string usage, std::string about, std::size_t positionals,
              std::vector<Flag> flags);

  /// False when the help was asked for and has been printed. Negative numbers are values; a flag of
  /// this program is never one, and no value is empty. Throws Error for what it does not take.
  bool Parse(int argc, char** argv);

  bool Has(const std::string& flag) const { return values_.count(flag) > 0; }
  std::string Text(const std::string& flag, const std::string& otherwise) const;
  /// A finite number in [min, max].
  double Number(const std::string& flag, double otherwise, double min, double max) const;
  /// A whole number in [min, max].
  int Whole(const std::string& flag, int otherwise, int min, int max) const;
  std::uint64_t Seed(const std::string& flag, std::uint64_t otherwise) const;
  /// Throws Error about the first of `needs` whose flag is given and which does not hold.
  void CheckNeeds(const std::vector<FlagNeed>& needs) const;
  const std::string& Positional(std::size_t index) const { return positionals_[index]; }
  const std::vector<std::string>& Positionals() const { return positionals_; }

 private:
  void PrintHelp() const;
  const Flag* Find(const std::string& name) const;

  std::string usage_;
  std::string about_;
  std::size_t wanted_positionals_;
  std::vector<Flag> flags_;
  std::map<std::string, std::string> values_;
  std::vector<std::string> positionals_;
};

/// Where nothing was measured: says so with `reason` on standard error.
void SayNothingMeasured(const char* name, const std::string& reason);

/// What a reader has mended in a file (datasets::Sequence::notes), a line each on standard error.
void SayNotes(const char* name, const std::vector<std::string>& notes);

/// Runs a program's body: an Error is printed as its sentence and gives exit status 2, any other
/// exception 1.
int RunProgram(const char* name, int argc, char** argv, int (*body)(int, char**));

}  // namespace livemap::tools
