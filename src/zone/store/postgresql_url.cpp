#include "zone/store/postgresql_url.h"

#include <libpq-fe.h>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "common/error.h"

namespace livemap::zone {

bool IsPostgresqlUrl(const std::string& database) {
  return database.rfind("postgresql://", 0) == 0 || database.rfind("postgres://", 0) == 0;
}

std::string CheckedPostgresqlUrl(const std::string& url) {
  const auto refuse = [&](const std::string& why) {
    throw Error("store_url '" + url + "' " + why +
                ", accepted is postgresql://USER@HOST/DATABASE, or "
                "postgresql:///DATABASE?host=FOLDER for a socket");
  };
  if (!IsPostgresqlUrl(url)) refuse("is no URL of PostgreSQL");
  const auto is_odd = [](unsigned char c) { return c <= ' ' || c == 0x7f; };
  if (std::any_of(url.begin(), url.end(), is_odd)) refuse("holds a blank or a control character");
  char* error = nullptr;
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(
      PQconninfoParse(url.c_str(), &error), &PQconninfoFree);
  if (options == nullptr) {
    const std::string why = error == nullptr ? "no memory" : error;
    PQfreemem(error);
    // libpq's sentence may repeat a password.
    throw Error("store_url cannot be read: " + why.substr(0, why.find('\n')));
  }
  const std::array<std::pair<std::string, const char*>, 3> wanted{
      {{"connect_timeout", "5"}, {"tcp_user_timeout", "20000"}, {"application_name", "livemap"}}};
  std::string checked = url;
  bool has_database = false;
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    const std::string keyword = option->keyword;
    const bool is_said = option->val != nullptr && *option->val != '\0';
    if (keyword == "dbname" && is_said) has_database = true;
    if ((keyword == "password" || keyword == "sslpassword") && is_said) {
      throw Error(
          "store_url holds a password, which every user of the machine could read; accepted is one "
          "in ~/.pgpass, or in the file of mode 600 that ?passfile=FILE names");
    }
    for (const auto& [name, value] : wanted) {
      if (keyword != name || is_said) continue;
      checked += checked.find('?') == std::string::npos ? '?' : '&';
      checked += name + "=" + value;
    }
  }
  if (!has_database) refuse("names no database");
  return checked;
}

}  // namespace livemap::zone
