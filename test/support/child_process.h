#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <functional>
#include <string>

namespace livemap::test {

/// Runs `body` in a process of its own, which may change its limits, rights and mounts, and returns
/// what it returned: a sentence about what went wrong, empty when all went well.
inline std::string RunInChild(const std::function<std::string()>& body) {
  int channel[2];
  if (pipe(channel) != 0) return "no pipe";
  const pid_t child = fork();
  if (child == 0) {
    std::string sentence;
    try {
      sentence = body();
    } catch (const std::exception& error) {
      sentence = std::string("unexpected: ") + error.what();
    }
    const bool written = write(channel[1], sentence.data(), sentence.size()) ==
                         static_cast<ssize_t>(sentence.size());
    _exit(written ? 0 : 1);
  }
  close(channel[1]);
  std::string sentence;
  char buffer[256];
  for (ssize_t count; (count = read(channel[0], buffer, sizeof(buffer))) > 0;) {
    sentence.append(buffer, static_cast<std::size_t>(count));
  }
  close(channel[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status))
    return "the child was killed by signal " + std::to_string(WTERMSIG(status));
  return sentence;
}

}  // namespace livemap::test
