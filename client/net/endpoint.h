/// HOST:PORT: moved to wire/endpoint.h, because the server reads it too.
#pragma once

#include "wire/endpoint.h"
