// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/method.h"

namespace virga {

inline constexpr SettingInfo kImsSettings[] = {
    {"mode", "exact",
     "exact: unbiased; fast: what x2 scatters is computed at some pixels alone, and upsampled (biased); frame: few "
     "lights and fixed points of lamps light everything, pictures are coherent over time (biased)"},
    {"samples", "16; frame: 4",
     "fast: samples of each of these pixels in a pass; frame: points of its eye ray that are lit, or paths where it "
     "sees a mirror or glass"},
    {"spacing", "8", "fast, frame: their distance in either direction [pixels]"},
    {"eye_steps", "64; frame: 128", "fast, frame: steps of an eye ray through each stretch of media, at most 128"},
    {"lamp_table", "0; 1.5 for each voxel where media are grids, 96 to 256",
     "fast: what media let through from point and spot lamps (at most 8) is looked up in tables of so many nodes in "
     "either direction, where all media are grids with nothing around them; 0: it is marched from each point"},
    {"walks", "8192; 256 with shadow maps; frame: 16384", "random walks from the lights in each pass"},
    {"walk_flights", "tracking",
     "of these walks through heterogeneous media: tracking; marching: in steps of half a cell of the grid (biased)"},
    {"aim", "0; frame: 0.5",
     "share of the walks that start toward the media, where these do not fill the scene: few walks find a small cloud"},
    {"retrace", "1",
     "part of the walks that is traced anew in a frame where only media change; the others are kept, 262144 of a "
     "frame's first passes (above 0: at least this part, more where media change fast)"},
    {"lights", "8; 1 where a medium is heterogeneous; frame: 1300",
     "single virtual lights that light a vertex, where no number of walks is given; frame: lights that are kept of "
     "all"},
    {"paths", "0", "walks whose virtual lights all light a vertex on the eye ray (P); 0: single lights"},
    {"radius",
     "0.3 times the scene's extent, or, without shapes, the mean free path; frame: by its neighbours, for each light",
     "virtual lights that are nearer are clamped, and what that takes is compensated [unit]"},
    {"bound", "1 / radius^2", "the same as a bound of the geometry term, in place of the radius [1/unit^2]"},
    {"compensation", "path; frame: spread",
     "path: eye paths go on within the radius; sampled: new vertices by restricted distances; none: clamped (biased); "
     "frame: spread, lights are balls of that radius (biased), none, or sampled: one level, reduced clamping behind it "
     "(biased; a path may be a segment longer than max_depth)"},
    {"levels", "-1", "sampled: levels of recursion; -1: until Russian roulette ends it"},
    {"ending", "unclamped", "sampled: beyond the last level: unclamped lights, reduced clamping, nothing (biased)"},
    {"v1", "1", "sampled: new vertices at the first level (V_1)"},
    {"v2", "1", "sampled: new vertices at each further level (V_2)"},
    {"p1", "0", "sampled: walks that light a vertex of the first level (P_1); 0: single lights"},
    {"p2", "0", "sampled: walks that light a vertex of further levels (P_2); 0: single lights"},
    {"transmittance", "exact",
     "sampled: to the new vertices: exact; mean: from the local mean of the medium (biased, more at each level); "
     "gradient: that, but exact where extinction changes on the way (biased)"},
    {"visibility", "exact; frame: shadow_map",
     "of virtual lights: exact; minimum_depth: exact, without rays where nothing can be in the way (not in frames); "
     "shadow_map, none (biased)"},
    {"map_resolution", "128; frame: 32", "shadow_map: of each light's map, texels in either direction"},
    {"map_points", "8192; frame: 0",
     "shadow_map: points of the scene's surfaces in each light's map; 0: a ray for each of its texels"},
    {"show", "picture", "picture; lost: only what clamping takes; compensation: only what is found again"},
    {"max_depth", "the scene's", "longest path in segments, -1 for no limit; 2 is direct light"},
    {"rr_depth", "the scene's", "scattering events of the eye path before Russian roulette by throughput begins"},
};

/// Instant multiple scattering: virtual point lights in media, with bias compensation.
std::unique_ptr<Method> createIms();

}  // namespace virga
