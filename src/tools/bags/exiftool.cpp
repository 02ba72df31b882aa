#include "tools/bags/exiftool.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "common/error.h"
#include "datasets/text_parsing.h"

namespace livemap::tools {
namespace {

constexpr char kExiftool[] = "exiftool";

/// Starts it with standard output into `output`; its id.
pid_t StartExiftool(const std::vector<std::string>& arguments, int output) {
  std::vector<std::string> words = {kExiftool};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, kExiftool, &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    throw Error(
        "the program exiftool cannot be started: it is in Debian's "
        "libimage-exiftool-perl");
  }
  return child;
}

std::string ReadAll(int input) {
  std::string text;
  std::array<char, 65536> piece{};
  for (;;) {
    const ssize_t size = read(input, piece.data(), piece.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0 || text.size() > datasets::kMaxTextBytes) return text;
    text.append(piece.data(), static_cast<std::size_t>(size));
  }
}

}  // namespace

std::string AskExiftool(const std::vector<std::string>& arguments) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw Error("no pipe to exiftool can be made");
  pid_t child = 0;
  try {
    child = StartExiftool(arguments, ends[1]);
  } catch (const Error&) {
    close(ends[0]);
    close(ends[1]);
    throw;
  }
  close(ends[1]);
  std::string text = ReadAll(ends[0]);
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (text.size() > datasets::kMaxTextBytes) throw Error("exiftool prints more than 256 MiB");
  return text;
}

}  // namespace livemap::tools
