// SPDX-License-Identifier: Apache-2.0
// Headers that most tests include: the build compiles them once. Every file still includes what it uses.
#pragma once

#include <gtest/gtest.h>

#include "core/precompiled.h"
#include "core/random.h"
#include "stats/stats.h"
