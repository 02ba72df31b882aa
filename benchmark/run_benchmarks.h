#pragma once

#include <benchmark/benchmark.h>

#include <cstdio>
#include <string>

namespace livemap::bench {

/// What a benchmark program does: --help, Google Benchmark's own options, a sentence and exit
/// status 2 for any other. `about` says what is measured, one or more lines.
inline int RunBenchmarks(int argc, char** argv, const char* program, const char* about,
                         benchmark::BenchmarkReporter* reporter = nullptr) {
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) != "--help") continue;
    std::printf(
        "usage: %s [GOOGLE BENCHMARK OPTIONS]\n\n%s\n"
        "Useful options: --benchmark_filter=REGEX --benchmark_min_time=SECONDS\n",
        program, about);
    return 0;
  }
  benchmark::Initialize(&argc, argv);
  if (argc > 1) {
    std::fprintf(stderr, "%s: unknown argument '%s', see --help\n", program, argv[1]);
    return 2;
  }
  if (reporter != nullptr) {
    benchmark::RunSpecifiedBenchmarks(reporter);
  } else {
    benchmark::RunSpecifiedBenchmarks();
  }
  return 0;
}

}  // namespace livemap::bench
