// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/eye_packet.h"

namespace virga {
namespace {

/// Kernels know all of it.
bool isPlainSmoke(const MediumView& medium) {
  return isPlainGrid(medium) && !medium.albedoGrid.values && medium.phaseBlends.size == 0 &&
         (medium.phase.get<Isotropic>() || medium.phase.get<HenyeyGreenstein>());
}

static_assert(KernelDepths::kMostSteps == MarchedEye::kSteps + 1);

}  // namespace

void EyePacket::clear() {
  eyes_ = {};
  for (int i = 0; i < kSize; ++i) eyes_.last[i] = -1;
  eyes_.from = KernelDepths::kMostSteps, eyes_.to = -1;
  medium_ = nullptr;
  taken_ = 0;
}

bool EyePacket::add(const SceneView& scene, size_t lane, const Ray& ray, const MediaState& media, float t0, float t1,
                    int steps, float shift) {
  if (media.count() != 1 || steps >= KernelDepths::kMostSteps) return false;
  const MediumView& medium = scene.media[media.medium(0)];
  if (medium_ ? medium_ != &medium : !isPlainSmoke(medium)) return false;
  medium_ = &medium;
  taken_ |= 1u << lane;
  const GridRay inGrid(medium, ray);
  const GridView& grid = medium.density;
  const ClippedRange in = clipToBox(inGrid.o, inGrid.d, grid.supportLo, grid.supportHi, t0, t1);
  if (!(in.t0 < in.t1)) return true;
  const ClippedRange filled = whereFilled(medium, ray, in.t0, in.t1);
  if (!(filled.t0 < filled.t1)) return true;
  const float step = (in.t1 - in.t0) / static_cast<float>(steps);
  const int first = std::max(0, static_cast<int>((filled.t0 - in.t0) / step + shift - 0.01f));
  const int last = std::min(steps, static_cast<int>((filled.t1 - in.t0) / step + shift + 0.01f));
  const Vec3 middle = inGrid.o + inGrid.d * (in.t0 + step * (0.5f - shift)) - grid.denseOrigin;
  const Vec3 along = inGrid.d * step;
  eyes_.ox[lane] = ray.o.x, eyes_.oy[lane] = ray.o.y, eyes_.oz[lane] = ray.o.z;
  eyes_.dx[lane] = ray.d.x, eyes_.dy[lane] = ray.d.y, eyes_.dz[lane] = ray.d.z;
  eyes_.gx[lane] = middle.x, eyes_.gy[lane] = middle.y, eyes_.gz[lane] = middle.z;
  eyes_.hx[lane] = along.x, eyes_.hy[lane] = along.y, eyes_.hz[lane] = along.z;
  eyes_.shift[lane] = shift;
  eyes_.begin[lane] = in.t0, eyes_.end[lane] = in.t1, eyes_.step[lane] = step;
  eyes_.first[lane] = first, eyes_.last[lane] = last;
  eyes_.from = std::min(eyes_.from, first), eyes_.to = std::max(eyes_.to, last);
  return true;
}

void EyePacket::remove(size_t lane) {
  taken_ &= ~(1u << lane);
  eyes_.last[lane] = -1;
}

void EyePacket::depthsAt(size_t lane, std::span<const float> distances, float* out) const {
  if (eyes_.first[lane] > eyes_.last[lane])
    std::fill(out, out + distances.size(), 0.f);
  else
    lookUpDepths(eyes_, depths_, static_cast<int>(lane), distances.data(), static_cast<int>(distances.size()), out);
}

void EyePacket::march() {
  if (empty() || eyes_.from > eyes_.to) {
    std::fill_n(depths_.total, kSize, 0.f), std::fill_n(depths_.opacity, kSize, 0.f);
    std::fill_n(depths_.meanPlace, kSize, 0.f);
    return;
  }
  // As MarchedEye::opaque().
  const Rgb s = medium_->spectrum;
  const float least = std::min(s.r, std::min(s.g, s.b));
  eyes_.thick = least > 0 ? MarchedEye::kOpaque / least : std::numeric_limits<float>::max();
  eyes_.sigmaT = medium_->sigmaT;
  for (int c = 0; c < 3; ++c) eyes_.spectrum[c] = s[c];
  const DenseGridView& box = medium_->density.dense;
  marchEyes({box.values, box.nx, box.ny, box.nz}, eyes_, depths_);
}

}  // namespace virga
