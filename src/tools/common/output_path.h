#pragma once

#include <string>
#include <vector>

namespace livemap::tools {

/// Refuses an output that would overwrite what is read. `what` names the output in the message
/// ("--out", "OUT.bag"). Throws Error where `output` is one of `inputs`, or a file that exists in a
/// folder of `inputs`; a bag counts there as the output of an earlier run, as no folder that is
/// read holds bags.
void CheckOutputFile(const std::string& what, const std::string& output,
                     const std::vector<std::string>& inputs);

/// Refuses a folder of outputs whose files would lie beside one of the files `inputs`. Throws Error
/// naming that file.
void CheckOutputFolder(const std::string& what, const std::string& output,
                       const std::vector<std::string>& inputs);

}  // namespace livemap::tools
