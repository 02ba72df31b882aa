#include "web/json/log_line.h"

#include "common/utc_text.h"
#include "web/json/json.h"

namespace livemap::web {

std::string LogLine(const LogRecord& record) {
  Json line;
  line["time"] = Rfc3339(record.time_ns);
  line["level"] = record.level;
  line["message"] = record.message;
  Json& fields = line["fields"];
  fields["node"] = record.node;
  if (!record.file.empty()) {
    fields["file"] = record.file;
    fields["line"] = record.line;
  }
  return ToText(line);
}

}  // namespace livemap::web
