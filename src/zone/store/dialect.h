#pragma once

// Part of ZoneStore; nobody else includes this.
#include <cstddef>
#include <initializer_list>
#include <string>

namespace livemap::zone {

/// How the two databases say what they say differently. All other SQL of the store is the same for
/// both. SQLite keeps any value in any column, so that its rows are asked for the types of their
/// values; PostgreSQL's columns have types, so that only the values themselves are left to ask for.
class Dialect {
 public:
  explicit Dialect(bool is_postgresql) : is_postgresql_(is_postgresql) {}

  struct TextColumn {
    const char* name;
    std::size_t max_bytes;
  };
  /// Conditions: each of these columns holds a text of so many bytes at most, an integer, a finite
  /// number. They have no parentheses and are joined by AND.
  std::string AreTexts(std::initializer_list<TextColumn> columns) const;
  std::string AreIntegers(std::initializer_list<const char*> columns) const;
  std::string AreNumbers(std::initializer_list<const char*> columns) const;
  std::string IsIntegerOrNull(const std::string& column) const;
  /// Condition: a uuid as Uuid::ToString writes it.
  std::string IsUuid(const std::string& column) const;
  /// The first `characters` of the column's text; "" where it holds none.
  std::string TextOrEmpty(const std::string& column, std::size_t characters) const;
  /// The greater, the smaller of two values that are not null.
  std::string Greater(const std::string& a, const std::string& b) const;
  std::string Smaller(const std::string& a, const std::string& b) const;

 private:
  bool is_postgresql_;
};

}  // namespace livemap::zone
