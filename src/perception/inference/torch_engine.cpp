// The one file that sees libtorch's headers: they take as long to compile as a room. It is a
// library of its own, which torch_library.cpp opens.
#include <ATen/Context.h>
#include <ATen/Parallel.h>
#include <c10/core/CPUAllocator.h>
#include <torch/script.h>
#include <torch/version.h>

#include <algorithm>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <thread>
#include <utility>

#include "common/error.h"
#include "perception/inference/block_cache.h"
#include "perception/inference/engines.h"
#include "perception/inference/torch_library.h"

namespace livemap::perception {
namespace {

/// The memory of all tensors of the process, on the CPU.
class TorchEngineMemory final : public c10::Allocator {
 public:
  c10::DataPtr allocate(std::size_t bytes) const override {
    void* block = bytes == 0 ? nullptr : Blocks().Take(bytes);
    return {block, block, &Give, c10::DeviceType::CPU};
  }
  c10::DeleterFnPtr raw_deleter() const override { return &Give; }

  /// From now on; tensors that are older keep theirs.
  static void Use() {
    static std::once_flag once;
    std::call_once(once, [] { c10::SetCPUAllocator(new TorchEngineMemory); });
  }

 private:
  static void Give(void* block) { Blocks().Give(block); }
  /// Never destroyed: libtorch's own static tensors may go later.
  static BlockCache& Blocks() {
    static auto* blocks = new BlockCache;
    return *blocks;
  }
};

/// OpenMP keeps its number of threads for each thread that calls it, and an engine may be made on
/// another thread than the one that runs it.
class TorchThreads {
 public:
  explicit TorchThreads(int threads)
      : threads_(threads > 0
                     ? threads
                     : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))) {}
  void Use() const {
    if (at::get_num_threads() != threads_) at::set_num_threads(threads_);
  }

 private:
  int threads_;
};

/// Only bytes with the manifest's hash come here: TorchScript is code as well as weights. `prepare`
/// is called with what was loaded.
template <typename Prepare>
void LoadTorchFile(const std::string& file, std::string content, Prepare prepare) {
  std::istringstream bytes(std::move(content));
  TorchEngineMemory::Use();
  try {
    torch::jit::Module network = torch::jit::load(bytes, c10::kCPU);
    network.eval();
    prepare(network);
  } catch (const std::exception& error) {
    throw Error("model file '" + file +
                "' cannot be loaded, accepted is a TorchScript file of libtorch " TORCH_VERSION
                " or older (" +
                FirstLine(error.what()) + ")");
  }
}

/// libtorch (TorchScript) on the CPU.
class TorchEngine final : public InferenceEngine {
 public:
  TorchEngine(const ModelManifest& manifest, int threads)
      : file_(manifest.torch_file), threads_(threads), input_(InputShape(manifest)) {
    const c10::InferenceMode inference_only;
    threads_.Use();
    LoadTorchFile(file_, ReadTorchFile(manifest), [&](torch::jit::Module& network) {
      network_ = torch::jit::optimize_for_inference(network);
    });
    CheckOutput(*this, manifest, file_);
  }

  cv::Mat Run(const cv::Mat& images) override {
    if (images.type() != CV_32F || !images.isContinuous() || ShapeOf(images) != input_) {
      throw Error("model file '" + file_ + "' cannot run on an input of " +
                  ShapeText(ShapeOf(images)) + ", its manifest accepts float32 of " +
                  ShapeText(input_));
    }
    const c10::InferenceMode inference_only;
    threads_.Use();
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
  std::string file_;
  TorchThreads threads_;
  std::vector<std::int64_t> input_;
  torch::jit::Module network_;
  at::Tensor output_;  ///< Holds the memory of the last answer.
};

/// The process's library for operators in 8 bits, chosen before the first file is loaded.
void UseOneDnn(const std::string& file) {
  try {
    at::globalContext().setQEngine(at::QEngine::ONEDNN);
  } catch (const std::exception& error) {
    throw Error("model file '" + file + "' cannot be loaded, this libtorch lacks oneDNN (" +
                FirstLine(error.what()) + ")");
  }
}

/// libtorch with a network in 8 bits, whose file has a method for each view: view_0 and on, from
/// the view's pixels to its rows.
class Int8Engine final : public InferenceEngine {
 public:
  Int8Engine(const ModelManifest& manifest, int threads)
      : file_(manifest.int8_file), threads_(threads), columns_(5 + manifest.classes.size()) {
    const c10::InferenceMode inference_only;
    threads_.Use();
    UseOneDnn(file_);
    LoadTorchFile(file_, ReadInt8File(manifest), [&](torch::jit::Module& network) {
      network_ = network;
      for (int view = 0; view < manifest.head.views; ++view) {
        views_.push_back({network.get_method("view_" + std::to_string(view)),
                          manifest.SizeOfView(view), manifest.AnchorCountOfView(view)});
      }
    });
    const int shape[] = {1, manifest.AnchorCount(), static_cast<int>(columns_)};
    output_.create(3, shape, CV_32F);
    CheckOutput(*this, manifest, file_);
  }

  cv::Mat Run(const cv::Mat& pixels) override { return RunViews(pixels, views_.size()); }
  cv::Mat RunFirstView(const cv::Mat& pixels) override { return RunViews(pixels, 1); }

  EngineKind Kind() const override { return EngineKind::kTorch; }
  Precision ComputesIn() const override { return Precision::kInt8; }

 private:
  struct View {
    torch::jit::Method method;
    cv::Size size;  ///< px
    int anchors;
  };

  /// The rows of the first `count` views.
  cv::Mat RunViews(const cv::Mat& pixels, std::size_t count) {
    if (pixels.type() != CV_8UC3 || !pixels.isContinuous() || pixels.size() != views_[0].size) {
      throw Error("model file '" + file_ + "' cannot run on an input of " +
                  ShapeText(ShapeOf(pixels)) + ", its manifest accepts 8 bits of " +
                  std::to_string(views_[0].size.height) + " x " +
                  std::to_string(views_[0].size.width) + " x 3");
    }
    const c10::InferenceMode inference_only;
    threads_.Use();
    float* rows = output_.ptr<float>();
    int anchors = 0;
    for (std::size_t i = 0; i < count; ++i) {
      View& view = views_[i];
      anchors += view.anchors;
      cv::Mat seen = pixels;
      if (view.size != pixels.size()) {
        cv::resize(pixels, scaled_, view.size, 0, 0, cv::INTER_LINEAR);
        seen = scaled_;
      }
      rows = RunView(view, seen, rows);
    }
    const int shape[] = {1, anchors, static_cast<int>(columns_)};
    return {3, shape, CV_32F, output_.data};
  }

  /// Writes the view's rows to `rows` and returns what follows them.
  float* RunView(View& view, const cv::Mat& seen, float* rows) {
    at::Tensor found;
    try {
      // from_blob wants a pointer to what it may change; the network does not.
      const at::Tensor input =
          torch::from_blob(const_cast<uchar*>(seen.data), {1, seen.rows, seen.cols, 3}, at::kByte);
      found = view.method({input.permute({0, 3, 1, 2})}).toTensor().to(at::kFloat).contiguous();
    } catch (const std::exception& error) {
      throw Error("model file '" + file_ + "' cannot run on an input of " +
                  ShapeText(ShapeOf(seen)) + " (" + FirstLine(error.what()) + ")");
    }
    const std::vector<std::int64_t> promised = {1, view.anchors,
                                                static_cast<std::int64_t>(columns_)};
    if (found.sizes() != at::IntArrayRef(promised)) {
      throw Error("model file '" + file_ + "' answers with a tensor of " +
                  ShapeText(found.sizes().vec()) + ", its manifest accepts " + ShapeText(promised));
    }
    return std::copy_n(found.data_ptr<float>(), found.numel(), rows);
  }

  std::string file_;
  TorchThreads threads_;
  std::size_t columns_;
  torch::jit::Module network_;
  std::vector<View> views_;
  cv::Mat scaled_;
  cv::Mat output_;
};

}  // namespace

}  // namespace livemap::perception

extern "C" livemap::perception::InferenceEngine* LiveMapMakeTorchEngine(
    const livemap::perception::ModelManifest& manifest, int threads, bool int8) {
  using namespace livemap::perception;
  if (int8) return std::make_unique<Int8Engine>(manifest, threads).release();
  return std::make_unique<TorchEngine>(manifest, threads).release();
}
