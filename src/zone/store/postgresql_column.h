#pragma once

// Part of ZoneStore; nobody else includes this.
#include <cstddef>
#include <cstdint>
#include <string>

namespace livemap::zone {

/// A type of PostgreSQL that the zone's rows have. The number is the type's object identifier,
/// which is the same in all servers.
enum class PostgresqlType : std::uint32_t {
  kInteger64 = 20,
  kInteger32 = 23,
  kText = 25,
  kDouble = 701,
};

/// The name of the type in SQL.
const char* NameOf(PostgresqlType type);

/// The values of one column in several rows, as PostgreSQL reads them in its binary format: the
/// server then parses no digits, and a number arrives with all its bits.
class PostgresqlColumn {
 public:
  explicit PostgresqlColumn(PostgresqlType type);

  /// Each adds the value of one more row, whose type is the column's. Throws StoreError for a text
  /// that holds a zero byte, which PostgreSQL does not keep, or of a size that no row has.
  void Add(const std::string& text);
  void Add(double number);
  void Add(long long number);
  void Add(int number);
  void AddNull();

  int rows() const { return rows_; }
  std::size_t bytes() const { return bytes_.size(); }
  /// The values alone, each after its size: what two columns have in common that are equal.
  std::string elements() const;

  /// What libpq sends: `size` bytes, or null. Holds until the column changes.
  struct Sent {
    const char* bytes = nullptr;
    int size = 0;
  };
  /// All rows, as an array.
  Sent Array();
  /// The value of a column of one row.
  Sent Only() const;

 private:
  void AddInteger(std::uint64_t bits, int bytes);
  void AddSize(std::size_t size);

  std::string bytes_;  ///< The header of an array, then the elements.
  int rows_ = 0;
  bool has_null_ = false;
};

}  // namespace livemap::zone
