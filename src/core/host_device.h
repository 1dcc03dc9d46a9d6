// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Marks a function that also compiles for the device (CUDA). Empty on the host.
#if defined(__CUDACC__)
#define VIRGA_HD __host__ __device__
#else
#define VIRGA_HD
#endif

namespace virga {

/// Asks for memory that is about to be read.
VIRGA_HD inline void prefetch([[maybe_unused]] const void* p) {
#if !defined(__CUDA_ARCH__)
  __builtin_prefetch(p);
#endif
}

}  // namespace virga
