#include "web/officials/account_body.h"

#include <gtest/gtest.h>

#include <string>

#include "web/http/request_target.h"

namespace livemap::web {
namespace {

using accounts::AccountEventKind;

std::string WhyNoAccountBody(AccountEventKind action, const std::string& text) {
  try {
    ParseAccountBody(action, text);
    return "";
  } catch (const BadRequest& mistake) {
    return mistake.what();
  }
}

TEST(AccountBodyTest, EachActionTakesItsOwnTexts) {
  const AccountBody added = ParseAccountBody(
      AccountEventKind::kAdd, R"({"name": "anna", "role": "viewer", "password": "secret"})");
  EXPECT_EQ(added.name, "anna");
  EXPECT_EQ(added.role, accounts::Role::kViewer);
  EXPECT_EQ(added.password, "secret");
  const AccountBody changed =
      ParseAccountBody(AccountEventKind::kRole, R"({"name": "anna", "role": "admin"})");
  EXPECT_EQ(changed.role, accounts::Role::kAdmin);
  EXPECT_FALSE(ParseAccountBody(AccountEventKind::kLock, R"({"name": "anna"})").role);
}

TEST(AccountBodyTest, WhatIsMissingTooMuchOrOfAnotherTypeIsRefusedWithWhatIsAccepted) {
  for (const char* text :
       {"", "[]", "{}", R"({"name": 1})", R"(["name"])", R"({"name": "a", "password": "b"})"}) {
    EXPECT_EQ(WhyNoAccountBody(AccountEventKind::kRemove, text),
              "the body is not accepted, accepted is an object of the text name")
        << text;
  }
  EXPECT_EQ(WhyNoAccountBody(AccountEventKind::kAdd, R"({"name": "a", "role": "viewer"})"),
            "the body is not accepted, accepted is an object of the texts name, role and password");
  EXPECT_EQ(WhyNoAccountBody(AccountEventKind::kSetPassword, R"({"name": "a", "password": null})"),
            "the body is not accepted, accepted is an object of the texts name and password");
  EXPECT_EQ(WhyNoAccountBody(AccountEventKind::kRole, R"({"name": "a", "role": "Admin"})"),
            "the role is not accepted, accepted are viewer, official and admin");
}

}  // namespace
}  // namespace livemap::web
