// SPDX-License-Identifier: Apache-2.0
#include "core/transform.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"

namespace virga {
namespace {

void expectNear(const Matrix4& a, const Matrix4& b, double tolerance = 1e-12) {
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) EXPECT_NEAR(a(i, j), b(i, j), tolerance) << i << " " << j;
}

void expectNear(Vec3 a, Vec3 b) { EXPECT_NEAR(distance(a, b), 0, 2e-6) << a.x << " " << a.y << " " << a.z; }

Matrix4 something() {
  return Matrix4::translation(3, -2, 0.5) * Matrix4::rotation(1, 2, -0.5, 37) * Matrix4::scaling(2, -0.3, 5);
}

TEST(Matrix4, TheRightmostFactorActsFirst) {
  const Affine a(Matrix4::translation(1, 2, 3) * Matrix4::scaling(2, 3, 4));
  EXPECT_EQ(a.point({1, 1, 1}), Vec3(3, 5, 7));
  EXPECT_EQ(a.vector({1, 1, 1}), Vec3(2, 3, 4));
}

TEST(Matrix4, RotationsFollowTheRightHand) {
  expectNear(Affine(Matrix4::rotation(0, 0, 1, 90)).vector({1, 0, 0}), {0, 1, 0});
  expectNear(Affine(Matrix4::rotation(1, 0, 0, 90)).vector({0, 1, 0}), {0, 0, 1});
  expectNear(Affine(Matrix4::rotation(0, 7, 0, 90)).vector({0, 0, 1}), {1, 0, 0});
  expectNear(Affine(Matrix4::rotation(1, 1, 1, 120)).vector({1, 0, 0}), {0, 1, 0});
  expectNear(Matrix4::rotation(0, 0, -2, 30), Matrix4::rotation(0, 0, 1, -30));
}

TEST(Matrix4, RotationsKeepLengthsAndTheirAxis) {
  Pcg32 rng(1);
  for (int i = 0; i < 100; ++i) {
    const double x = rng.next() - 0.5, y = rng.next() - 0.5, z = rng.next() - 0.5;
    const Matrix4 r = Matrix4::rotation(x, y, z, 720 * static_cast<double>(rng.next()) - 360);
    Matrix4 transposed;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) transposed(row, column) = r(column, row);
    expectNear(r * transposed, Matrix4());
    EXPECT_NEAR(r.determinant3(), 1, 1e-12);
    for (int row = 0; row < 3; ++row) {
      const double axis[] = {x, y, z};
      EXPECT_NEAR(r(row, 0) * x + r(row, 1) * y + r(row, 2) * z, axis[row], 1e-12);
    }
  }
}

TEST(Matrix4, InverseUndoes) {
  expectNear(something() * something().inverse(), Matrix4());
  expectNear(something().inverse() * something(), Matrix4());
  EXPECT_TRUE(something().inverse().isAffine());
  expectNear(Matrix4::scaling(1e-6, 1e6, 1).inverse(), Matrix4::scaling(1e6, 1e-6, 1), 1e-6);
}

TEST(Matrix4, DeterminantIsTheVolumeWithItsSign) { EXPECT_NEAR(something().determinant3(), 2 * -0.3 * 5, 1e-12); }

TEST(Matrix4, SingularMeansFlat) {
  EXPECT_FALSE(something().isSingular());
  EXPECT_FALSE(Matrix4::scaling(1e-5, 1e-5, 1e-5).isSingular()) << "small is not flat";
  EXPECT_FALSE(Matrix4::scaling(1e9, 1e9, 1e9).isSingular());
  EXPECT_FALSE(Matrix4::scaling(2e6, 1, 1).isSingular()) << "nor is thin";
  EXPECT_FALSE(Matrix4::scaling(1e6, 1e-5, 1).isSingular());
  EXPECT_TRUE(Matrix4::scaling(1, 1, 0).isSingular());
  EXPECT_TRUE(Matrix4::scaling(0, 0, 0).isSingular());
  EXPECT_TRUE(Matrix4::scaling(1, 1, 1e-13).isSingular());
  EXPECT_TRUE(Matrix4::scaling(1, 1, std::nan("")).isSingular());
}

TEST(Matrix4, FiniteAndAffineLookAtEveryEntryThatMatters) {
  Matrix4 m;
  EXPECT_TRUE(m.isFinite() && m.isAffine());
  m(3, 0) = 0.1;
  EXPECT_FALSE(m.isAffine());
  m(3, 0) = std::nan("");
  EXPECT_FALSE(m.isFinite());
}

TEST(Matrix4, LookAtHasXToTheLeft) {
  const Affine camera(Matrix4::lookAt({1, 2, 3}, {1, 2, 13}, {0, 1, 0}));
  expectNear(camera.point({0, 0, 0}), {1, 2, 3});
  expectNear(camera.vector({0, 0, 1}), {0, 0, 1});
  expectNear(camera.vector({0, 1, 0}), {0, 1, 0});
  expectNear(camera.vector({1, 0, 0}), {1, 0, 0});
  // Along -z, what lies to the left of the viewer is -x.
  expectNear(Affine(Matrix4::lookAt({0, 0, 5}, {0, 0, 0}, {0, 1, 0})).vector({1, 0, 0}), {-1, 0, 0});
}

TEST(Matrix4, LookAtIsARotationForSkewUp) {
  const Matrix4 m = Matrix4::lookAt({4, -1, 2}, {0.5, 3, -7}, {0.3, 5, 1});
  EXPECT_NEAR(m.determinant3(), 1, 1e-12);
  const Affine camera(m);
  expectNear(camera.vector({0, 0, 1}), normalize(Vec3(-3.5f, 4, -9)));
  EXPECT_GT(dot(camera.y, Vec3(0.3f, 5, 1)), 0);
  EXPECT_NEAR(dot(camera.x, Vec3(0.3f, 5, 1)), 0, 1e-5) << "up stays upright in the picture";
}

TEST(Matrix4, LookAtAlongUpIsNotFinite) {
  EXPECT_FALSE(Matrix4::lookAt({0, 0, 0}, {0, 1, 0}, {0, 2, 0}).isFinite());
  EXPECT_FALSE(Matrix4::lookAt({1, 1, 1}, {1, 1, 1}, {0, 1, 0}).isFinite());
}

TEST(Affine, AgreesWithTheMatrix) {
  const Affine a(something()), identity;
  const Vec3 p(0.3f, -0.7f, 2);
  for (int i = 0; i < 3; ++i) {
    const auto expected = something()(i, 0) * p.x + something()(i, 1) * p.y + something()(i, 2) * p.z;
    EXPECT_NEAR(a.vector(p)[i], expected, 1e-5);
    EXPECT_NEAR(a.point(p)[i], expected + something()(i, 3), 1e-5);
  }
  EXPECT_EQ(identity.point(p), p);
  EXPECT_EQ(identity.transposed(p), p);
}

TEST(Affine, TransposedInverseKeepsNormalsNormal) {
  const Affine forward(something()), inverse(something().inverse());
  const Vec3 tangent(1, 2, -1), normal(3, -1, 1);
  ASSERT_EQ(dot(tangent, normal), 0);
  EXPECT_NEAR(dot(forward.vector(tangent), inverse.transposed(normal)), 0, 1e-5);
  EXPECT_GT(std::fabs(dot(forward.vector(tangent), forward.vector(normal))), 0.1f) << "cannot fail";
}

}  // namespace
}  // namespace virga
