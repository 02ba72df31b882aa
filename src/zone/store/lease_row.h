#pragma once

// Part of ZoneStore and ZoneLease; nobody else includes this.

namespace livemap::zone {

/// The one row that says which process is the active one of the zone, of PostgreSQL alone. `writer`
/// is the server's process for the connection over which the holder writes; 0: none yet.
inline constexpr char kMakeLeaseTable[] =
    R"(CREATE TABLE IF NOT EXISTS livemap_lease (
         only_row INTEGER PRIMARY KEY CHECK (only_row = 1),
         holder TEXT NOT NULL,
         epoch BIGINT NOT NULL,
         valid_until TIMESTAMP WITH TIME ZONE NOT NULL,
         writer INTEGER NOT NULL) WITH (fillfactor = 50))";
inline constexpr char kMakeLeaseRow[] =
    "INSERT INTO livemap_lease (only_row, holder, epoch, valid_until, writer) VALUES (1, '', 0, "
    "'1970-01-01 00:00:00+00', 0) ON CONFLICT DO NOTHING";
/// To be the first statement of a transaction that makes its connection the holder's writer.
inline constexpr char kBecomeWriter[] =
    "UPDATE livemap_lease SET writer = pg_backend_pid() WHERE epoch = :e RETURNING epoch";
/// Keeps the lease with its holder until the end of the transaction.
inline constexpr char kCheckLease[] = "SELECT epoch FROM livemap_lease WHERE epoch = :e FOR SHARE";

}  // namespace livemap::zone
