#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/sqlite.h"
#include "geo/map_cell.h"
#include "protocol/cell_news.h"
#include "protocol/duplicate_filter.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/notice.h"
#include "protocol/report.h"
#include "vehicle/outbox/report_salvage.h"
#include "vehicle/outbox/row_validation.h"
#include "vehicle/reporting/notice_sequence_tracker.h"

namespace livemap::vehicle {

/// What the vehicle knows about one hazard.
struct KnownHazard {
  Uuid id;  ///< The zone's once it has told; until then that of the vehicle's own report.
  bool of_zone = false;
  std::string class_name;
  float confidence = 0;
  geo::GeoPoint position;
  std::string zone;  ///< Id of the zone in which it lies.
};

/// The vehicle's memory: the hazards it knows, its own and those that the zones announced, up to
/// which of each zone's announcements it knows all, of the zone and of single cells of the map, and
/// its reports that their zone has not
/// answered yet (the outbox). All stand in one durable SQLite database, so that "known" and "to be
/// sent" are one transaction: what Add accepted is reported whatever dies.
///
/// A vehicle that changes zones knows hazards of several. Each zone counts its announcements for
/// itself, so every hazard, report and sequence here belongs to one zone, and no zone's word
/// touches what belongs to another one. Where a report, notice or receipt names no zone, it is of
/// the configured one.
///
/// Not thread-safe. Every method that writes throws StoreError when the store fails; then nothing
/// has changed.
class LocalHazardMap {
 public:
  struct Config {
    std::string path;  ///< The database file; its directory exists.
    /// Id of the configured zone, to which all belongs that names none, rows of an older LiveMap
    /// included. Empty: there is one zone only, whatever its id.
    std::string zone;
    /// Hazards kept; beyond it the ones longest without news are forgotten (and would be reported
    /// anew), never one whose report is unfinished.
    int max_known = 100000;
    /// Unfinished reports kept; beyond it new hazards are refused, nothing accepted is dropped.
    int max_pending = 1000;
    /// The same in bytes: of each report its picture and kReportBytes.
    double max_pending_bytes = 200e6;
  };
  static constexpr std::size_t kReportBytes = 1024;

  enum class AddResult {
    kAdded,      ///< Durably known and to be sent.
    kDuplicate,  ///< Of a known hazard; nothing is stored.
    kFull,       ///< Too many unfinished reports, or bytes of them; nothing is stored.
  };

  struct PendingReport {
    Uuid uuid;
    std::string class_name;
    std::int64_t created_ns = 0;     ///< The report's stamp.
    bool sent = false;               ///< At least once.
    std::int64_t hold_until_ns = 0;  ///< As for Add.
  };

  /// Opens or creates the database. A corrupt file is renamed to `<path>.corrupt-<now_ns>` with
  /// its companions and a new one started, with those of its reports that can still be read: see
  /// set_aside() and salvage(). In a sound file rows of impossible values count for nothing: see
  /// broken_rows(). Throws Error for every other failure.
  LocalHazardMap(const Config& config, const protocol::HazardCatalogue& catalogue,
                 std::int64_t now_ns);

  /// Where a corrupt database was moved; empty when the file was sound.
  const std::string& set_aside() const { return set_aside_; }
  /// What became of the reports in it.
  const Salvage& salvage() const { return salvage_; }
  /// What was found that the program cannot have written.
  const InvalidRows& broken_rows() const { return broken_rows_; }

  /// The known hazard that a sighting duplicates.
  std::optional<protocol::DuplicateFilter::Match> Find(const std::string& class_name,
                                                       const geo::GeoPoint& position) const;
  /// `hold_until_ns` is kept with it, for whoever sends it: UTC by the vehicle's clock, until which
  /// it may wait for a cheap link; 0: not at all.
  AddResult Add(const protocol::Report& report, std::int64_t hold_until_ns = 0);

  /// Takes in what zones announced, in one transaction. Returns how many were unusable (nil id,
  /// impossible position, overlong class name, a hazard of another zone or in its area) and left
  /// out. A kCaughtUp
  /// takes away what its zone no longer has; one that came without all that belongs to it counts as
  /// unusable.
  std::size_t Apply(const std::vector<protocol::Notice>& notices);
  /// What became of a zone's word about cells of the map.
  struct CellUse {
    std::vector<geo::MapCell> known;  ///< Of which the vehicle knows all now.
    std::size_t unusable = 0;         ///< Hazards and cells that were left out, as for notices.
  };
  /// Takes in what a zone told of cells, in one transaction. Where it tells all that is there, what
  /// it does not tell is forgotten. What answers a question that the vehicle cannot have asked is
  /// left out.
  CellUse Apply(const protocol::CellNews& news);
  /// Up to which announcement of the zone the vehicle knows all of the cell; 0: it knows nothing of
  /// it. As map_sequence.
  std::uint64_t cell_sequence(const std::string& zone, const geo::MapCell& cell) const;
  /// An announcement of the cell came ahead of one that is missing.
  bool has_cell_gap(const std::string& zone, const geo::MapCell& cell) const;
  /// Whether a place is none of a zone's business (ZoneFinder::is_beyond): what the zone says is
  /// there is left out. What it said before stays until it takes it back.
  void RefuseBeyond(std::function<bool(const std::string&, const geo::GeoPoint&)> is_beyond) {
    is_beyond_ = std::move(is_beyond);
  }
  /// How many notices were left out for that, since the start.
  std::uint64_t beyond_zone() const { return beyond_zone_; }
  /// Up to which announcement of the zone with this id the vehicle knows all; 0: none. An empty id
  /// is the configured zone's. Survives a restart.
  std::uint64_t map_sequence(const std::string& zone = "") const;
  /// Announcements of some zone came ahead of one that is missing.
  bool has_gap() const;
  /// How many zones have announced anything.
  std::size_t zone_count() const { return zones_.size(); }
  /// Ends the report that the receipt answers; false when no such report is unfinished, or when
  /// another zone than the report's answers. A committed
  /// hazard goes on under the zone's id. A refused one stays known, or it would be reported anew
  /// at the next sight.
  bool Apply(const protocol::Receipt& receipt);

  /// Gives an unfinished report, with what is known of its hazard, to the zone with this id.
  void GiveZone(const Uuid& report, const std::string& zone);
  /// Forgets what the zones told of which `is_gone` says so, the configured one excepted: nobody
  /// takes their hazards back any more. The vehicle's own unfinished reports stay.
  void ForgetZones(const std::function<bool(const std::string&)>& is_gone);

  std::vector<PendingReport> Pending() const;
  /// Forgets hazards that the zone took in but never announced, whose class's expected life has
  /// passed since they were seen: the zone tells nobody when it gives up such a one. Seen again,
  /// they are reported anew. Returns how many.
  std::size_t ForgetUnannounced(std::int64_t now_ns);

  /// The whole report, as it was added.
  std::optional<protocol::Report> LoadPending(const Uuid& uuid) const;
  void MarkSent(const Uuid& uuid);

  /// At most `limit` known hazards, those with the newest news first.
  std::vector<KnownHazard> Known(std::size_t limit) const;
  std::size_t known_count() const { return filter_.size(); }
  std::size_t pending_count() const { return pending_count_; }
  /// As max_pending_bytes counts them.
  std::size_t pending_bytes() const { return pending_bytes_; }

 private:
  /// What one zone has announced so far.
  struct ZoneMemory {
    NoticeSequenceTracker chain;
    std::set<Uuid> told;  // To this vehicle alone, since the last kCaughtUp.
  };

  /// A cell of a zone, by its id and the cell's number.
  using CellKey = std::pair<std::string, std::uint32_t>;
  using Chains = std::map<CellKey, NoticeSequenceTracker>;

  /// What becomes of a notice.
  enum class NoticeUse { kTaken, kUnusable, kBeyondZone };

  /// What a transaction did to `known`, for the filter after its commit.
  struct Change {
    Uuid id;
    bool known;  ///< False: forgotten.
    std::string class_name;
    geo::GeoPoint position;
  };

  /// What one transaction does, for memory after its commit.
  struct Taking {
    std::map<std::string, ZoneMemory> zones;  ///< Those that say something, as they become.
    Chains cells;                             ///< The same of their cells.
    std::vector<Change> changes;
    std::uint64_t beyond_zone = 0;  ///< Of what was left out: in another zone's area.
  };

  std::string ZoneOf(const std::string& named) const;
  void GiveRowsTheirZone();
  void RecoverFromSetAside();
  void LoadFilter();
  void CountPending();
  void InsertKnown(const protocol::Report& report, const std::string& zone);
  ZoneMemory* Remember(const std::string& zone, std::map<std::string, ZoneMemory>& zones) const;
  NoticeSequenceTracker& RememberCell(const CellKey& key, Chains& cells) const;
  NoticeUse ApplyNotice(const protocol::Notice& notice, const std::string& zone, ZoneMemory& memory,
                        Taking& taking);
  NoticeUse TakeHazard(const protocol::Notice& notice, const std::string& zone,
                       std::vector<Change>& changes);
  bool TakeCell(const protocol::CellNews::Cell& cell, const std::string& zone, Taking& taking,
                std::size_t& unusable);
  void ForgetOfCell(const protocol::CellNews::Cell& cell, const std::string& zone,
                    const std::set<Uuid>& told, std::vector<Change>& changes);
  void WriteSequences(const Taking& taking);
  void Keep(Taking taking);
  void ForgetOldestCells();
  bool IsOfAnotherZone(const Uuid& hazard, const std::string& zone) const;
  bool IsNews(const protocol::Notice& notice, const std::string& zone) const;
  void StoreNotice(const protocol::Notice& notice, const std::string& zone);
  void LearnPasses(const protocol::Notice& notice, const std::string& zone);
  static std::optional<std::string> StoredTrails(const protocol::Notice& notice);
  bool CatchUp(const protocol::Notice& notice, const std::string& zone, ZoneMemory& memory,
               std::vector<Change>& changes);
  std::vector<Uuid> NotTold(const protocol::Notice& notice, const std::string& zone,
                            const std::set<Uuid>& told) const;
  void Forget(const Uuid& id, std::vector<Change>& changes);
  void EvictBeyondLimit(std::vector<Change>& changes, Chains& cells);
  void Show(const std::vector<Change>& changes);

  Config config_;
  protocol::HazardCatalogue catalogue_;
  std::string set_aside_;
  Salvage salvage_;
  InvalidRows broken_rows_;
  std::unique_ptr<SqliteDatabase> database_;
  protocol::DuplicateFilter filter_;
  std::map<std::string, ZoneMemory> zones_;  // By id.
  Chains cells_;
  std::function<bool(const std::string&, const geo::GeoPoint&)> is_beyond_;  // May be empty.
  std::uint64_t beyond_zone_ = 0;
  std::size_t pending_count_ = 0;
  std::size_t pending_bytes_ = 0;
};

}  // namespace livemap::vehicle
