#include "common/wire/protobuf_log.h"

#include <google/protobuf/stubs/logging.h>

namespace needlelab {

void keepProtobufQuiet() {
  google::protobuf::SetLogHandler(nullptr);
}

}  // namespace needlelab
