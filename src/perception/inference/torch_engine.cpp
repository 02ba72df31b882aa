// The one file that sees libtorch's headers: they take as long to compile as a room.
#include <ATen/Parallel.h>
#include <c10/core/CPUAllocator.h>
#include <torch/script.h>
#include <torch/version.h>

#include <mutex>
#include <sstream>
#include <thread>

#include "common/error.h"
#include "perception/inference/block_cache.h"
#include "perception/inference/engines.h"

namespace livemap::perception {
namespace {

/// The memory of all tensors of the process, on the CPU.
class TensorMemory final : public c10::Allocator {
 public:
  c10::DataPtr allocate(std::size_t bytes) const override {
    void* block = bytes == 0 ? nullptr : Blocks().Take(bytes);
    return {block, block, &Give, c10::DeviceType::CPU};
  }
  c10::DeleterFnPtr raw_deleter() const override { return &Give; }

  /// From now on; tensors that are older keep theirs.
  static void Use() {
    static std::once_flag once;
    std::call_once(once, [] { c10::SetCPUAllocator(new TensorMemory); });
  }

 private:
  static void Give(void* block) { Blocks().Give(block); }
  /// Never destroyed: libtorch's own static tensors may go later.
  static BlockCache& Blocks() {
    static auto* blocks = new BlockCache;
    return *blocks;
  }
};

/// libtorch (TorchScript) on the CPU.
class TorchEngine final : public InferenceEngine {
 public:
  TorchEngine(const ModelManifest& manifest, int threads)
      : file_(manifest.torch_file), threads_(threads), input_(InputShape(manifest)) {
    if (threads_ == 0)
      threads_ = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    // Only bytes with the manifest's hash reach the loader: TorchScript is code as well as weights.
    std::istringstream bytes(ReadTorchFile(manifest));
    const c10::InferenceMode inference_only;
    TensorMemory::Use();
    try {
      UseThreads();
      network_ = torch::jit::load(bytes, c10::kCPU);
      network_.eval();
      network_ = torch::jit::optimize_for_inference(network_);
    } catch (const std::exception& error) {
      throw Error("model file '" + file_ +
                  "' cannot be loaded, accepted is a TorchScript file of libtorch " TORCH_VERSION
                  " or older (" +
                  FirstLine(error.what()) + ")");
    }
    CheckOutput(*this, manifest, file_);
  }

  cv::Mat Run(const cv::Mat& images) override {
    if (images.type() != CV_32F || !images.isContinuous() || ShapeOf(images) != input_) {
      throw Error("model file '" + file_ + "' cannot run on an input of " +
                  ShapeText(ShapeOf(images)) + ", its manifest accepts float32 of " +
                  ShapeText(input_));
    }
    const c10::InferenceMode inference_only;
    UseThreads();
    try {
      // from_blob wants a pointer to what it may change; the network does not.
      const at::Tensor input =
          torch::from_blob(const_cast<uchar*>(images.data), input_, at::kFloat);
      output_ = network_.forward({input}).toTensor().to(at::kFloat).contiguous();
    } catch (const std::exception& error) {
      throw Error("model file '" + file_ + "' cannot run on an input of " +
                  ShapeText(ShapeOf(images)) + " (" + FirstLine(error.what()) + ")");
    }
    const std::vector<int> shape(output_.sizes().begin(), output_.sizes().end());
    return {static_cast<int>(shape.size()), shape.data(), CV_32F, output_.data_ptr<float>()};
  }

  EngineKind Kind() const override { return EngineKind::kTorch; }

 private:
  /// OpenMP keeps its number of threads for each thread that calls it, and an engine may be made on
  /// another thread than the one that runs it.
  void UseThreads() const {
    if (at::get_num_threads() != threads_) at::set_num_threads(threads_);
  }

  std::string file_;
  int threads_;
  std::vector<std::int64_t> input_;
  torch::jit::Module network_;
  at::Tensor output_;  ///< Holds the memory of the last answer.
};

}  // namespace

bool HasTorchEngine() { return true; }

std::unique_ptr<InferenceEngine> MakeTorchEngine(const ModelManifest& manifest, int threads) {
  return std::make_unique<TorchEngine>(manifest, threads);
}

}  // namespace livemap::perception
