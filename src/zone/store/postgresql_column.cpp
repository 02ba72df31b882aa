#include "zone/store/postgresql_column.h"

#include <cstring>

#include "common/sqlite.h"

namespace livemap::zone {
namespace {

// As array_recv() of PostgreSQL reads them: dimensions, whether there are nulls, the type, the
// number of elements, the index of the first; then each element after its size.
constexpr std::size_t kArrayHasNullAt = 4;
constexpr std::size_t kArrayRowsAt = 12;
constexpr std::size_t kArrayHeaderBytes = 20;
constexpr std::size_t kElementSizeBytes = 4;
constexpr std::uint32_t kSizeOfNull = 0xffffffff;
/// Of everything that a message may carry; a text of the zone is far shorter.
constexpr std::size_t kMostColumnTextBytes = 16 << 20;

void PutColumnBytes(std::uint64_t bits, int bytes, char* to) {
  for (int i = 0; i < bytes; ++i) to[i] = static_cast<char>(bits >> (8 * (bytes - 1 - i)) & 0xff);
}

}  // namespace

const char* NameOf(PostgresqlType type) {
  switch (type) {
    case PostgresqlType::kInteger64:
      return "int8";
    case PostgresqlType::kInteger32:
      return "int4";
    case PostgresqlType::kDouble:
      return "float8";
    case PostgresqlType::kText:
      break;
  }
  return "text";
}

PostgresqlColumn::PostgresqlColumn(PostgresqlType type) {
  for (const std::uint32_t word : {1U, 0U, static_cast<std::uint32_t>(type), 0U, 1U}) {
    AddInteger(word, 4);
  }
}

void PostgresqlColumn::Add(const std::string& text) {
  if (text.find('\0') != std::string::npos) {
    throw StoreError("store: a text holds a zero byte, which PostgreSQL does not keep");
  }
  if (text.size() > kMostColumnTextBytes) {
    throw StoreError("store: a text has " + std::to_string(text.size()) +
                     " bytes, accepted are up to " + std::to_string(kMostColumnTextBytes));
  }
  AddSize(text.size());
  bytes_ += text;
  ++rows_;
}

void PostgresqlColumn::Add(double number) {
  static_assert(sizeof(double) == sizeof(std::uint64_t));
  std::uint64_t bits = 0;
  std::memcpy(&bits, &number, sizeof bits);
  AddSize(sizeof bits);
  AddInteger(bits, sizeof bits);
  ++rows_;
}

void PostgresqlColumn::Add(long long number) {
  AddSize(8);
  AddInteger(static_cast<std::uint64_t>(number), 8);
  ++rows_;
}

void PostgresqlColumn::Add(int number) {
  AddSize(4);
  AddInteger(static_cast<std::uint32_t>(number), 4);
  ++rows_;
}

void PostgresqlColumn::AddNull() {
  AddSize(kSizeOfNull);
  has_null_ = true;
  ++rows_;
}

std::string PostgresqlColumn::elements() const { return bytes_.substr(kArrayHeaderBytes); }

PostgresqlColumn::Sent PostgresqlColumn::Array() {
  PutColumnBytes(has_null_ ? 1 : 0, 4, &bytes_[kArrayHasNullAt]);
  PutColumnBytes(static_cast<std::uint32_t>(rows_), 4, &bytes_[kArrayRowsAt]);
  return {bytes_.data(), static_cast<int>(bytes_.size())};
}

PostgresqlColumn::Sent PostgresqlColumn::Only() const {
  if (has_null_) return {};
  constexpr std::size_t kValueAt = kArrayHeaderBytes + kElementSizeBytes;
  return {bytes_.data() + kValueAt, static_cast<int>(bytes_.size() - kValueAt)};
}

void PostgresqlColumn::AddSize(std::size_t size) { AddInteger(size, kElementSizeBytes); }

void PostgresqlColumn::AddInteger(std::uint64_t bits, int bytes) {
  const std::size_t at = bytes_.size();
  bytes_.resize(at + static_cast<std::size_t>(bytes));
  PutColumnBytes(bits, bytes, &bytes_[at]);
}

}  // namespace livemap::zone
