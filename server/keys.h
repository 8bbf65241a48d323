// `voxeld keys add | set | list | revoke | rotate-urls`: works on the key file of a data directory,
// also while a daemon runs on it, which sees the change with its next request.
#pragma once

#include "server/config.h"

namespace voxeld {

// `add` prints the key alone to stdout, what else there is to say to stderr. Returns the exit
// status: 64 for what cannot be asked for, 1 for a file that cannot be read or written.
int keys_main(const KeysCommand& command);

}  // namespace voxeld
