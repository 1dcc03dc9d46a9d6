// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "methods/instant_scattering/frame_lights.h"
#include "transport/vertex.h"

namespace virga {

/// A point on an eye ray, x1, that all virtual lights of a frame light; or one beyond it, x2.
struct Receiver {
  Vertex vertex;
  Rgb throughput;                    ///< to the eye, what the vertex scatters left out
  int pixel = 0;                     ///< whose light it is: a number within its batch
  VertexKind x1 = VertexKind::none;  ///< kind of the point on the eye ray, if the vertex lies beyond it
};

/// Receivers of a few pixels, gathered from all lights at once.
class ReceiverBatch {
 public:
  enum class Visibility { exact, none, maps };  ///< maps: as far as the lights have them
  struct Options {
    NearField near;  ///< a bound of 0: each light has its own
    Visibility visibility = Visibility::exact;
  };

  ReceiverBatch();
  void add(const SceneView& scene, const Receiver& receiver);

  /// What the lights send by way of the receivers: found(Receiver::pixel, kind of x1, kind of x2, light).
  using Found = std::function<void(int, VertexKind, VertexKind, Rgb)>;
  void gather(const Scene& scene, const FrameLights& lights, const Options& options, const Found& found);

 private:
  /// Of one kind, in the arrays that kernels take.
  struct Group {
    EndKind kind = EndKind::lambertian;
    bool plain = true;  ///< otherwise light arrives by the vertices' own scattering
    std::vector<float> px, py, pz, ax, ay, az, anisotropy, sum[3], seen[3];
    std::vector<Receiver> receivers;

    KernelReceivers view();
    void clearSums();
  };

  /// Scattering times cosine of a plain receiver.
  static float plainScattering(const Group& group, size_t n, Vec3 w);
  static void look(const Scene& scene, const FrameLights& lights, size_t i, Group& group, const Options& options,
                   float* seen[3]);
  static void gatherSlowly(const FrameLights& lights, size_t i, const SceneView& scene, Group& group,
                           const NearField& near, float* const seen[3]);
  static void distribute(const Group& group, VertexKind lights, const Found& found);

  static constexpr int kGroups = 4;  ///< one for each EndKind, and the last for what is not plain
  Group groups_[kGroups];
};

}  // namespace virga
