#include "web/http/answer_writer.h"

#include <algorithm>
#include <boost/beast/http/status.hpp>
#include <cstdio>
#include <string_view>
#include <utility>

namespace livemap::web {
namespace {

constexpr std::size_t kLeastCompressedBytes = 1024;
constexpr std::size_t kGzipBytes = 72 << 10;

bool IsText(const std::string& content_type) {
  return content_type.rfind("text/", 0) == 0 || content_type.rfind("application/", 0) == 0 ||
         content_type.rfind("image/svg", 0) == 0;
}

std::string_view WholeContent(const HttpResponse& answer) {
  if (!answer.kept) return answer.content;
  return {reinterpret_cast<const char*>(answer.kept->data()), answer.kept->size()};
}

void AddField(std::string& header, std::string_view name, std::string_view value) {
  header.append(name).append(": ").append(value).append("\r\n");
}

/// A chunk of RFC 9112 section 7.1.
std::string Chunk(const std::string& data) {
  if (data.empty()) return "";
  char size[20];
  std::snprintf(size, sizeof size, "%zx\r\n", data.size());
  return size + data + "\r\n";
}

}  // namespace

AnswerWriter::AnswerWriter(HttpResponse answer, const AnswerForm& form)
    : answer_(std::move(answer)), form_(form), keep_alive_(form.keep_alive) {}

std::size_t AnswerWriter::HeldBytes() const {
  const std::size_t kept_bytes = answer_.kept ? answer_.kept->size() : 0;
  return answer_.content.size() + kept_bytes + 2 * kPieceBytes + (form_.gzip ? kGzipBytes : 0);
}

bool AnswerWriter::Gather() {
  if (answer_.pieces) {
    is_last_ = !answer_.pieces(gathered_);
    return is_last_ || gathered_.size() >= kPieceBytes;
  }
  const std::string_view rest = WholeContent(answer_).substr(sent_bytes_);
  gathered_ = rest.substr(0, kPieceBytes);
  sent_bytes_ += gathered_.size();
  is_last_ = gathered_.size() == rest.size();
  return true;
}

std::string AnswerWriter::Encode(std::string piece, bool is_last) {
  if (gzip_) piece = gzip_->Compress(piece, is_last);
  if (!is_chunked_) return piece;
  piece = Chunk(piece);
  if (is_last) piece += "0\r\n\r\n";
  return piece;
}

std::string AnswerWriter::Begin() {
  const bool has_content = answer_.status != 304;
  std::string piece = has_content ? std::exchange(gathered_, "") : "";
  if (!has_content) is_last_ = true;
  const std::size_t whole_bytes = answer_.pieces ? piece.size() : WholeContent(answer_).size();
  const bool is_text = has_content && IsText(answer_.content_type);
  const bool compresses =
      is_text && form_.gzip && (whole_bytes >= kLeastCompressedBytes || !is_last_);
  if (compresses) gzip_ = std::make_unique<GzipStream>();
  const bool knows_length = !gzip_ && (is_last_ || !answer_.pieces);
  std::string content;
  std::string length;
  if (knows_length) {
    length = std::to_string(whole_bytes);
    content = std::move(piece);
  } else if (is_last_) {
    content = Encode(std::move(piece), true);  // Small enough to be counted.
    length = std::to_string(content.size());
  } else {
    is_chunked_ = form_.chunked;
    if (!is_chunked_) keep_alive_ = false;
    if (!form_.head_only) content = Encode(std::move(piece), false);
  }

  std::string header = "HTTP/1.1 " + std::to_string(answer_.status) + " ";
  const auto reason =
      boost::beast::http::obsolete_reason(static_cast<boost::beast::http::status>(answer_.status));
  header.append(reason.data(), reason.size()).append("\r\n");
  for (const auto& [name, value] : answer_.headers) {
    // What a cache keeps compressed is not byte for byte what it keeps as it is.
    const bool is_weak = gzip_ && name == "ETag" && value.rfind("W/", 0) != 0;
    AddField(header, name, is_weak ? "W/" + value : value);
  }
  if (has_content && !answer_.content_type.empty()) {
    AddField(header, "Content-Type", answer_.content_type);
  }
  if (is_text) AddField(header, "Vary", "Accept-Encoding");
  if (gzip_) AddField(header, "Content-Encoding", "gzip");
  if (has_content && !length.empty()) AddField(header, "Content-Length", length);
  if (is_chunked_) AddField(header, "Transfer-Encoding", "chunked");
  if (!keep_alive_) AddField(header, "Connection", "close");
  header += "\r\n";
  if (form_.head_only) {
    is_last_ = true;
    return header;
  }
  return header + content;
}

bool AnswerWriter::Next(std::string& part) {
  part.clear();
  if (IsDone()) {
    answer_ = HttpResponse();
    return false;
  }
  if (answer_.status != 304 && !Gather()) return true;
  if (is_started_) {
    // Compression may keep a piece to itself.
    part = Encode(std::exchange(gathered_, ""), is_last_);
  } else {
    is_started_ = true;
    part = Begin();
  }
  return true;
}

}  // namespace livemap::web
