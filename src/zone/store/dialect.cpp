#include "zone/store/dialect.h"

namespace livemap::zone {
namespace {

template <typename Columns, typename Condition>
std::string ForEachColumn(const Columns& columns, const Condition& condition) {
  std::string all;
  for (const auto& column : columns) {
    if (!all.empty()) all += " AND ";
    all += condition(column);
  }
  return all;
}

}  // namespace

std::string Dialect::AreTexts(std::initializer_list<TextColumn> columns) const {
  return ForEachColumn(columns, [this](const TextColumn& column) {
    const std::string name = column.name;
    const std::string most = std::to_string(column.max_bytes);
    if (is_postgresql_) return "octet_length(" + name + ") <= " + most;
    return "typeof(" + name + ") = 'text' AND length(CAST(" + name + " AS BLOB)) <= " + most;
  });
}

std::string Dialect::AreIntegers(std::initializer_list<const char*> columns) const {
  return ForEachColumn(columns, [this](const std::string& name) {
    return is_postgresql_ ? name + " IS NOT NULL" : "typeof(" + name + ") = 'integer'";
  });
}

std::string Dialect::AreNumbers(std::initializer_list<const char*> columns) const {
  return ForEachColumn(columns, [this](const std::string& name) {
    // PostgreSQL orders NaN behind infinity. SQLite has no NaN, and infinity is found by who reads.
    return is_postgresql_ ? "abs(" + name + ") < 'Infinity'"
                          : "typeof(" + name + ") IN ('real', 'integer')";
  });
}

std::string Dialect::IsIntegerOrNull(const std::string& column) const {
  return is_postgresql_ ? "TRUE" : "typeof(" + column + ") IN ('integer', 'null')";
}

std::string Dialect::IsUuid(const std::string& column) const {
  if (is_postgresql_) {
    return column + " ~ '^[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}$'";
  }
  return "typeof(" + column + ") = 'text' AND length(CAST(" + column + " AS BLOB)) = 36 AND " +
         column + " LIKE '________-____-____-____-____________' AND replace(" + column +
         ", '-', '') NOT GLOB '*[^0-9a-f]*' AND length(replace(" + column + ", '-', '')) = 32";
}

std::string Dialect::TextOrEmpty(const std::string& column, std::size_t characters) const {
  const std::string begin = "substr(" + column + ", 1, " + std::to_string(characters) + ")";
  if (is_postgresql_) return "coalesce(" + begin + ", '')";
  return "CASE WHEN typeof(" + column + ") = 'text' THEN " + begin + " ELSE '' END";
}

std::string Dialect::Greater(const std::string& a, const std::string& b) const {
  return (is_postgresql_ ? "greatest(" : "max(") + a + ", " + b + ")";
}

std::string Dialect::Smaller(const std::string& a, const std::string& b) const {
  return (is_postgresql_ ? "least(" : "min(") + a + ", " + b + ")";
}

}  // namespace livemap::zone
