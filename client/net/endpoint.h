/// HOST:PORT: moved to wire/endpoint.h, because the server reads it too.
#pragma once

#include "common/wire/endpoint.h"
