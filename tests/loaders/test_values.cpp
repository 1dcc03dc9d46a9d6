// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "loading.h"

namespace virga {
namespace {

using namespace loading;

std::string element(const std::string& tag, const std::string& value) {
  return "<" + tag + " name=\"x\" value=\"" + value + "\"/>";
}

void expectBad(const std::string& tag, const std::string& value, const std::string& message) {
  expectError(scene(element(tag, value)), message);
}

TEST(Values, Numbers) {
  EXPECT_EQ(parsed<double>(element("float", "0.1")), 0.1);
  EXPECT_EQ(parsed<double>(element("float", " -1.5e-3 ")), -1.5e-3);
  EXPECT_EQ(parsed<double>(element("float", "+2")), 2);
  EXPECT_EQ(parsed<int64_t>(element("integer", "-9223372036854775808")), std::numeric_limits<int64_t>::min());
  EXPECT_EQ(parsed<int64_t>(element("integer", "+7")), 7);
  EXPECT_TRUE(parsed<bool>(element("boolean", "true")));
  EXPECT_FALSE(parsed<bool>(element("boolean", "False")));
  EXPECT_EQ(parsed<std::string>(element("string", " a &amp; &lt;b&gt; ")), " a & <b> ");
}

TEST(Values, NumbersAreStrict) {
  expectBad("float", "[[1.5x]]", "\"1.5x\" is not a number");
  expectBad("float", "[[1.5 2]]", "\"1.5 2\" is not a number");
  expectBad("float", "[[1,5]]", "\"1,5\" is not a number");
  expectBad("float", "[[]]", "\"\" is not a number");
  expectBad("float", " [[nan]]", "\"nan\" is not a finite number");
  expectBad("float", "[[inf]]", "\"inf\" is not a finite number");
  expectBad("float", "[[-infinity]]", "is not a finite number");
  expectBad("float", "[[1e999]]", "\"1e999\" does not fit a number");
  expectBad("float", "[[+-1]]", "is not a number");
  expectBad("float", "[[0x10]]", "is not a number");
  expectBad("integer", "[[64.0]]", "\"64.0\" is not an integer");
  expectBad("integer", "[[9223372036854775808]]", "does not fit an integer of 64 bits");
  expectBad("boolean", "[[yes]]", "\"yes\" is not a boolean");
  expectBad("boolean", "[[yes]]", "write true or false");
}

TEST(Values, Vectors) {
  EXPECT_EQ(parsed<Vec3>("<point name='x' x='1' y='2' z='-3'/>"), Vec3(1, 2, -3));
  EXPECT_EQ(parsed<Vec3>("<vector name='x' value='1, 2 ,3'/>"), Vec3(1, 2, 3));
  EXPECT_EQ(parsed<Vec3>("<vector name='x' value='4 5\t6'/>"), Vec3(4, 5, 6));
  EXPECT_EQ(parsed<Vec3>("<vector name='x' value='2'/>"), Vec3(2));
  expectBad("vector", "[[1, 2]]", "expected 3 numbers, found 2");
  expectBad("vector", "1, [[2q]], 3", "\"2q\" is not a number");
  expectBad("point", "[[1e39 0 0]]", "does not fit single precision");
  expectError(scene("<[[point]] name='x' x='1' y='2'/>"), "<point> needs the attribute \"z\"");
  expectError(scene("<[[point]] name='x' x='1' value='2'/>"), "both \"value\" and \"x\"");
}

TEST(Values, Colours) {
  EXPECT_EQ(parsed<Rgb>(element("rgb", "0.25")), Rgb(0.25f));
  EXPECT_EQ(parsed<Rgb>(element("rgb", "0.1, 0.2, 0.3")), Rgb(0.1f, 0.2f, 0.3f));
  EXPECT_EQ(parsed<Rgb>(element("rgb", "0.1 0.2 0.3")), Rgb(0.1f, 0.2f, 0.3f));
  EXPECT_EQ(parsed<Rgb>(element("spectrum", "0.5")), Rgb(0.5f));
  expectBad("rgb", "[[1 2]]", "expected 1 or 3 numbers, found 2");
  expectBad("rgb", "[[]]", "expected 1 or 3 numbers, found 0");
}

TEST(Values, HexadecimalColoursAreSrgb) {
  EXPECT_EQ(parsed<Rgb>(element("rgb", "#ff00FF")), Rgb(1, 0, 1));
  const Rgb c = parsed<Rgb>(element("rgb", "#0a80bc"));
  EXPECT_NEAR(c.r, 10 / 255.0 / 12.92, 1e-7);  // below the knee of the curve
  EXPECT_NEAR(c.g, 0.2158605, 1e-6);           // the well-known value of byte 128
  EXPECT_NEAR(c.b, std::pow((188 / 255.0 + 0.055) / 1.055, 2.4), 1e-6);
  expectBad("rgb", "[[#12345]]", "\"#12345\" is not a colour");
  expectBad("rgb", "[[#12345g]]", "hexadecimal colours are #rrggbb");
  expectBad("rgb", "[[#-12345]]", "is not a colour");
}

TEST(Values, SpectraByWavelengthAreRefused) {
  expectBad("spectrum", "[[400:0.3, 700:0.7]]", "lists of wavelengths are not supported");
  expectBad("spectrum", "[[400:0.3, 700:0.7]]", "write <rgb name=\"...\" value=\"r, g, b\"/>");
  expectBad("spectrum", "[[0.1, 0.2, 0.3]]", "a spectrum is one number, found 3");
  expectError(scene("<spectrum name='x' [[type]]='d65'/>"), "spectra from plugins or files");
  expectError(scene("<spectrum name='x' [[filename]]='a.spd'/>"), "spectra from plugins or files");
}

Matrix4 transform(const std::string& steps) { return parsed<Matrix4>("<transform name='x'>" + steps + "</transform>"); }

void expectNear(const Matrix4& a, const Matrix4& b) {
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) EXPECT_NEAR(a(i, j), b(i, j), 1e-12) << "row " << i << ", column " << j;
}

TEST(Transforms, Steps) {
  expectNear(transform(""), Matrix4());
  expectNear(transform("<translate x='1' z='3'/>"), Matrix4::translation(1, 0, 3));
  expectNear(transform("<translate value='1, 2, 3'/>"), Matrix4::translation(1, 2, 3));
  expectNear(transform("<scale value='2'/>"), Matrix4::scaling(2, 2, 2));
  expectNear(transform("<scale y='5'/>"), Matrix4::scaling(1, 5, 1));
  const Matrix4 quarter{{0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};  // x to y
  expectNear(transform("<rotate z='1' angle='90'/>"), quarter);
  expectNear(transform("<rotate value='0, 0, 7' angle='90'/>"), quarter);
}

TEST(Transforms, Matrices) {
  const Matrix4 full{{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 0, 1}};
  EXPECT_EQ(transform("<matrix value='1 2 3 4  5 6 7 8  9 10 11 12  0 0 0 1'/>"), full);
  const Matrix4 linear{{1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0, 0, 0, 0, 1}};
  EXPECT_EQ(transform("<matrix value='1, 2, 3, 4, 5, 6, 7, 8, 9'/>"), linear);
}

TEST(Transforms, LaterStepsActLater) {
  // (1, 0, 0) -> (2, 0, 0) -> (0, 2, 0) -> (10, 2, 0)
  const Matrix4 m = transform("<scale value='2'/><rotate z='1' angle='90'/><translate x='10'/>");
  EXPECT_NEAR(m(0, 0) + m(0, 3), 10, 1e-12);
  EXPECT_NEAR(m(1, 0) + m(1, 3), 2, 1e-12);
  EXPECT_NEAR(m(2, 0) + m(2, 3), 0, 1e-12);
}

TEST(Transforms, LookAt) {
  const Matrix4 m = transform("<lookat origin='1, 2, 3' target='1, 2, 13' up='0, 1, 0'/>");
  expectNear(m, Matrix4{{1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1}});
}

TEST(Transforms, LookAtWithoutUpIsSomeFrame) {
  for (const char* target : {"0, 0, 1", "0, 0, -1", "1, 0, 0", "0, 1, 0", "-3, 0.1, -2"}) {
    const Matrix4 m = transform(std::string("<lookat origin='0, 0, 0' target='") + target + "'/>");
    EXPECT_NEAR(m.determinant3(), 1, 1e-12) << target;
    EXPECT_TRUE(m.isFinite()) << target;
  }
}

void expectBadStep(const std::string& steps, const std::string& message) {
  expectError(scene("<transform name='x'>" + steps + "</transform>"), message);
}

TEST(Transforms, Errors) {
  expectBadStep("<[[rotat]] x='1' angle='3'/>", "unknown transform <rotat>");
  expectBadStep("<[[rotat]] x='1' angle='3'/>", "did you mean \"rotate\"?");
  expectBadStep("<[[rotate]] x='1'/>", "needs the attribute \"angle\"");
  expectBadStep("<[[rotate]] x='0' angle='3'/>", "the axis of a rotation must not be zero");
  expectBadStep("<[[translate]]/>", "needs \"value\", or \"x\", \"y\" and \"z\"");
  expectBadStep("<[[scale]] value='1' x='2'/>", "both \"value\" and");
  expectBadStep("<scale x='1' [[w]]='2'/>", "<scale> has no attribute \"w\"");
  expectBadStep("<matrix value='[[1 2 3]]'/>", "expected 9 or 16 numbers, found 3");
  expectBadStep("<matrix value='[[1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0]]'/>", "the last row of a transform must be 0 0 0 1");
  expectBadStep("<lookat origin='1,1,1' target='[[1, 1, 1]]' up='0,1,0'/>", "origin and target are the same point");
  expectBadStep("<lookat origin='0,0,0' target='0, 5, 0' up='[[0, 1, 0]]'/>", "\"up\" must not be zero");
  expectBadStep("<lookat origin='0,0,0' target='0, 5, 0' up='[[0, 0, 0]]'/>", "\"up\" must not be zero");
  expectBadStep("<scale value='2'><[[scale]] value='2'/></scale>", "<scale> holds a value and no other elements");
  expectError(scene("<[[transform]] name='x'><scale value='1e200'/><scale value='1e200'/></transform>"), "overflows");
  expectError(scene("<[[transform]]/>"), "<transform> needs the attribute \"name\"");
}

}  // namespace
}  // namespace virga
