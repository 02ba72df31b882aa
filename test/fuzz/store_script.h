#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/sqlite.h"
#include "test/fuzz/fuzz_bytes.h"

namespace livemap::fuzz {

/// A folder of this process in memory where there is such a place.
inline std::string FuzzFolder(const char* name) {
  const bool memory = std::filesystem::is_directory("/dev/shm");
  std::string pattern = std::string(memory ? "/dev/shm/" : "/tmp/") + name + "_XXXXXX";
  if (mkdtemp(pattern.data()) == nullptr) std::abort();
  return pattern;
}

/// A table whose rows the script may change; `keys` are SQL literals of column `key`.
struct FuzzTable {
  std::string name;
  std::string key;
  std::vector<std::string> columns;
  std::vector<std::string> keys;
};

/// The rows that something else may change: all but `spared`, a literal of the key.
inline FuzzTable ReadFuzzTable(SqliteDatabase& database, const std::string& name,
                               const std::string& key, const std::string& spared = "") {
  FuzzTable table{name, key, {}, {}};
  SqliteStatement columns = database.Prepare("SELECT name FROM pragma_table_info('" + name + "')");
  while (columns.Step()) table.columns.push_back(columns.Text(0));
  SqliteStatement keys = database.Prepare("SELECT quote(" + key + ") FROM " + name + " ORDER BY 1");
  while (keys.Step()) {
    if (keys.Text(0) != spared) table.keys.push_back(keys.Text(0));
  }
  return table;
}

/// One value as an SQL literal: of any type and size, the awkward ones more often.
inline std::string FuzzLiteral(FuzzBytes& bytes) {
  constexpr const char* kAwkward[] = {"NULL",
                                      "9e999",
                                      "-9e999",
                                      "-1",
                                      "0",
                                      "1",
                                      "4294967296",
                                      "9223372036854775807",
                                      "-9223372036854775808",
                                      "1152921504606846976",
                                      "1e308",
                                      "1e-308",
                                      "''",
                                      "x''",
                                      "'nan'",
                                      "zeroblob(200000)",
                                      "printf('%200000s', 'x')",
                                      "printf('%.64c', 'a')",
                                      "x'00000000000000000000000000000000'"};
  switch (bytes.Below(5)) {
    case 0:
      return kAwkward[bytes.Below(std::size(kAwkward))];
    case 1:
      return std::to_string(bytes.Any<std::int32_t>());
    case 2:
      return std::to_string(bytes.Any<float>()) + "e0";
    default: {
      constexpr char kDigits[] = "0123456789abcdef";
      const bool text = bytes.Below(2) == 0;
      std::string hex;
      for (const char c : bytes.Text()) {
        hex += kDigits[static_cast<unsigned char>(c) >> 4];
        hex += kDigits[static_cast<unsigned char>(c) & 15];
      }
      return text ? "CAST(x'" + hex + "' AS TEXT)" : "x'" + hex + "'";
    }
  }
}

/// Changes, adds and removes rows as the input says. What the schema refuses does not happen.
inline void RunStoreScript(SqliteDatabase& database, const std::vector<FuzzTable>& tables,
                           FuzzBytes& bytes) {
  database.Execute("PRAGMA foreign_keys=OFF");
  for (int step = 0; step < 16 && !bytes.empty(); ++step) {
    const FuzzTable& table = tables[bytes.Below(tables.size())];
    const std::size_t what = bytes.Below(8);
    const std::string column = table.columns[bytes.Below(table.columns.size())];
    const std::string value = FuzzLiteral(bytes);
    if (table.keys.empty()) continue;
    const std::string where =
        " WHERE " + table.key + " = " + table.keys[bytes.Below(table.keys.size())];
    std::string sql = "UPDATE " + table.name + " SET " + column + " = " + value + where;
    if (what == 0) sql = "DELETE FROM " + table.name + where;
    if (what == 1) {
      sql = "INSERT INTO " + table.name + " SELECT ";
      const std::string key = FuzzLiteral(bytes);
      for (const std::string& other : table.columns) {
        if (&other != &table.columns.front()) sql += ", ";
        sql += other == column ? value : other == table.key ? key : other;
      }
      sql += " FROM " + table.name + where;
    }
    try {
      database.Execute(sql);
    } catch (const StoreError&) {
    }
  }
}

}  // namespace livemap::fuzz
