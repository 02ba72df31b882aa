#include "zone/store/queries.h"

#include "common/error.h"

namespace livemap::zone {

StoreDamage LoadRows(StoreConnection& connection, const std::string& table, soci::statement& query,
                     const std::function<void()>& take_row) {
  StoreDamage damage;
  long long rows = 0;
  connection.session() << "SELECT count(*) FROM " << table, soci::into(rows);
  connection.Run(query);
  while (query.fetch()) {
    --rows;
    try {
      take_row();
    } catch (const StoreError&) {
      throw;
    } catch (const Error& error) {
      damage.Note(error.what());
    }
  }
  for (; rows > 0; --rows) damage.Note("a row of " + table + " has values of a wrong type or size");
  return damage;
}

}  // namespace livemap::zone
