#include "nodes/word_program.h"

#include <exception>
#include <iostream>

namespace livemap::nodes {

int RunWordProgram(const char* name, const char* help, int argc, char** argv,
                   const std::function<void(const std::vector<std::string>&)>& body) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  bool asks_for_help = false;
  for (const std::string& word : words) asks_for_help |= word == "--help" || word == "-h";
  try {
    if (asks_for_help) {
      std::cout << help;
    } else {
      body(words);
    }
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << '\n';
    return 2;
  }
  // A full disk shows only now: half of an answer must not look like a whole one.
  if (std::cout.flush()) return 0;
  std::cerr << name << ": what it prints cannot be written\n";
  return 1;
}

}  // namespace livemap::nodes
