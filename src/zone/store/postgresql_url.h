#pragma once

#include <string>

namespace livemap::zone {

/// Whether the text names a database of PostgreSQL, as `postgresql://USER@HOST/DATABASE` or
/// `postgres://...`; else ZoneStore takes it for the path of a SQLite file.
bool IsPostgresqlUrl(const std::string& database);

/// The URL with what the zone wants of a connection where the URL says nothing of it: an end to
/// waiting for a server that does not answer, and a name in the server's lists. Throws Error for a
/// URL that libpq does not read or that names no database, and for one that holds a password: other
/// users of the machine read command lines and parameters.
std::string CheckedPostgresqlUrl(const std::string& url);

}  // namespace livemap::zone
