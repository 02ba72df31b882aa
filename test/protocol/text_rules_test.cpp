#include "protocol/text_rules.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/hazard_catalogue.h"

namespace livemap::protocol {
namespace {

TEST(TextRules, ATextOfBlanksOfAnyScriptSaysNothing) {
  for (const std::string blank : {" ", "   ", "\xc2\xa0", "\xe2\x80\x83", "\xe3\x80\x80",
                                  "\xe2\xa0\x80", "\xe1\x9a\x80", "\xe3\x85\xa4", "\xef\xbe\xa0",
                                  "\xe1\x85\x9f", " \xe2\x80\xaf ", "\xef\xb8\x8f", "\xcc\x81"}) {
    EXPECT_FALSE(IsAcceptableText(blank, 64)) << blank;
  }
}

TEST(TextRules, OrdinaryTextOfManyScriptsIsAcceptable) {
  for (const std::string text :
       {"filled yesterday", "trou \xc3\xa9norme", "\xe7\xa9\xb4", "\xf0\x9f\x9a\xa7",
        "\xe2\x9a\xa0\xef\xb8\x8f danger", "k\xc3\xa1ty\xc3\xba"}) {
    EXPECT_TRUE(IsAcceptableText(text, 64)) << text;
  }
}

TEST(TextRules, WhatIsInvisibleOrPiledUpIsRefused) {
  for (const std::string text :
       {"pot\xcd\x8fhole", "pot\xe3\x85\xa4hole", "pot\xee\x80\x80hole", "pot\xf3\xb0\x80\x80hole",
        "pot\xef\xbf\xbdhole", "pot\xe2\x80\x8bhole",
        "a\xcc\x81\xcc\x81\xcc\x81\xcc\x81\xcc\x81"}) {
    EXPECT_FALSE(IsAcceptableText(text, 64)) << text;
  }
  EXPECT_TRUE(IsAcceptableText("a\xcc\x81\xcc\x81", 64));
  EXPECT_FALSE(IsAcceptableText(std::string(65, 'x'), 64));
}

TEST(TextRules, ANameHasNoBlankAtItsEndsAndNoSelector) {
  EXPECT_TRUE(IsAcceptableName("car 1", 64));
  for (const std::string name : {" car-1", "car-1 ", "car-1\xc2\xa0", "car-1\xef\xb8\x8f"}) {
    EXPECT_FALSE(IsAcceptableName(name, 64)) << name;
  }
}

TEST(TextRules, TrimmingTakesTheBlanksAtTheEndsOnly) {
  EXPECT_EQ(Trimmed("  pot hole\xc2\xa0\xe3\x80\x80"), "pot hole");
  EXPECT_EQ(Trimmed(" \xe2\x80\x83 "), "");
  EXPECT_EQ(Trimmed(""), "");
  EXPECT_EQ(Trimmed(" \xff "), " \xff ");
}

TEST(TextRules, EveryClassOutsideTheCatalogueHasOneHeading) {
  const auto catalogue = HazardCatalogue::Parse("classes: {pothole: {}, deer: {}}\n", "test");
  EXPECT_EQ(catalogue.HeadingOf("pothole"), "pothole");
  EXPECT_EQ(catalogue.HeadingOf(" pothole\xc2\xa0"), "pothole");
  for (const std::string name : {"p\xd0\xbethole", "Pothole", "spam-1", "spam-2", "<b>"}) {
    EXPECT_EQ(catalogue.HeadingOf(name), kOtherClass) << name;
    EXPECT_FALSE(catalogue.Names(name)) << name;
  }
  EXPECT_EQ(catalogue.Get(kOtherClass).label, "Other");
  // A catalogue that names none takes every name.
  EXPECT_EQ(HazardCatalogue().HeadingOf("spam-1"), "spam-1");
}

}  // namespace
}  // namespace livemap::protocol
