#include "web/officials/account_api.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "accounts/account_store.h"
#include "common/clock.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr char kSamePassword[] = "correct horse battery";

/// Of somebody who has logged in.
struct LoggedIn {
  std::string cookie;
  std::string csrf_token;

  Headers ToRead() const { return {{"Cookie", cookie}}; }
  Headers ToChange() const {
    return {{"Cookie", cookie}, {"X-CSRF-Token", csrf_token}, {"Content-Type", "application/json"}};
  }
};

class AccountApiTest : public testing::Test {
 protected:
  AccountApiTest() {
    const std::string file = folder_.path() + "/accounts.sqlite";
    accounts::AccountStore store(file, {});
    store.Add("jones", accounts::Role::kViewer, kSamePassword, SystemNs());
    store.Add("miller", accounts::Role::kOfficial, kSamePassword, SystemNs());
    store.Add("root", accounts::Role::kAdmin, kSamePassword, SystemNs());
    Restart();
  }

  void Restart() {
    WebConfig options = TestOptions();
    options.accounts_file = folder_.path() + "/accounts.sqlite";
    options.token_file = tokens_.path();
    server_.reset();
    server_ = std::make_unique<WebServer>(options, *fixture_.zone, fixture_.catalogue);
  }
  HttpResult Confirm(const std::string& password, const Headers& headers) {
    return Request(port(), "POST", "/api/v1/session/confirm", headers,
                   nlohmann::json{{"password", password}}.dump());
  }

  int port() const { return server_->port(); }
  HttpResult TryLogIn(const std::string& name, const std::string& password = kSamePassword) {
    return Request(port(), "POST", "/api/v1/session", {{"Content-Type", "application/json"}},
                   nlohmann::json{{"name", name}, {"password", password}}.dump());
  }
  LoggedIn LogIn(const std::string& name) {
    const HttpResult answer = TryLogIn(name);
    EXPECT_EQ(answer.status, 200) << answer.body;
    const std::string cookie = answer.Field("Set-Cookie");
    return {cookie.substr(0, cookie.find(';')), answer.Json().value("csrf_token", "")};
  }
  HttpResult Do(const std::string& what, const std::string& name, const Headers& headers) {
    return Change(what, {{"name", name}}, headers);
  }
  HttpResult Change(const std::string& what, const nlohmann::json& body, const Headers& headers) {
    return Request(port(), "POST", "/api/v1/accounts/" + what, headers, body.dump());
  }
  bool IsLoggedIn(const LoggedIn& somebody) {
    return !Get(port(), "/api/v1/session", somebody.ToRead()).Json()["name"].is_null();
  }

  TokenFile tokens_;
  TemporaryFolder folder_;
  ZoneFixture fixture_;
  std::unique_ptr<WebServer> server_;
};

TEST_F(AccountApiTest, OnlyAnAdminWhoHasLoggedInSeesAndChangesAccounts) {
  const LoggedIn official = LogIn("miller");
  const Headers token{{"Authorization", "Bearer " + TokenFile::token()},
                      {"Content-Type", "application/json"}};
  for (const char* address : {"/api/v1/accounts", "/api/v1/accounts/events"}) {
    EXPECT_EQ(Get(port(), address).status, 401);
    EXPECT_EQ(Get(port(), address, token).status, 401) << "a program's token is no admin";
    EXPECT_EQ(Get(port(), address, official.ToRead()).status, 403);
    EXPECT_EQ(Get(port(), address, LogIn("root").ToRead()).status, 200);
  }
  EXPECT_EQ(Do("lock", "jones", official.ToChange()).status, 403);
  EXPECT_EQ(Do("lock", "jones", token).status, 401);
  for (const char* what : {"add", "role", "password", "remove", "end_sessions"}) {
    EXPECT_EQ(Do(what, "jones", official.ToChange()).status, 403) << what;
    EXPECT_EQ(Do(what, "jones", token).status, 401) << what;
  }
  LoggedIn forged = LogIn("root");
  forged.csrf_token[0] = forged.csrf_token[0] == '0' ? '1' : '0';
  EXPECT_EQ(Do("lock", "jones", forged.ToChange()).status, 403);
  EXPECT_EQ(Do("remove", "jones", forged.ToChange()).status, 403);
  EXPECT_EQ(TryLogIn("jones").status, 200) << "nothing was locked";
}

TEST_F(AccountApiTest, AChangeWantsTheOwnPasswordAgainWhereItWasNotShownLately) {
  const LoggedIn admin = LogIn("root");
  EXPECT_EQ(Do("lock", "jones", admin.ToChange()).status, 200) << "the log-in has shown it";
  Restart();  // It forgets when.
  EXPECT_EQ(Get(port(), "/api/v1/accounts", admin.ToRead()).status, 200);
  for (const char* what : {"unlock", "remove", "end_sessions"}) {
    const HttpResult refusal = Do(what, "jones", admin.ToChange());
    EXPECT_EQ(refusal.status, 403) << what;
    EXPECT_EQ(refusal.Json()["confirm"], true) << refusal.body;
  }
  EXPECT_EQ(Confirm("wrong horse battery", admin.ToChange()).status, 401);
  EXPECT_EQ(Do("unlock", "jones", admin.ToChange()).status, 403);
  EXPECT_EQ(Confirm(kSamePassword, admin.ToChange()).status, 200);
  EXPECT_EQ(Do("unlock", "jones", admin.ToChange()).status, 200);
}

TEST_F(AccountApiTest, APasswordIsConfirmedForOneSessionAndByItsPageAlone) {
  const LoggedIn admin = LogIn("root");
  const LoggedIn elsewhere = LogIn("root");
  Restart();
  LoggedIn forged = admin;
  forged.csrf_token[0] = forged.csrf_token[0] == '0' ? '1' : '0';
  EXPECT_EQ(Confirm(kSamePassword, forged.ToChange()).status, 403);
  EXPECT_EQ(Confirm(kSamePassword, {{"Content-Type", "application/json"}}).status, 401);
  EXPECT_EQ(Request(port(), "POST", "/api/v1/session/confirm", admin.ToChange(), "[]").status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/session/confirm", admin.ToRead()).status, 405);
  EXPECT_EQ(Confirm(kSamePassword, admin.ToChange()).status, 200);
  EXPECT_EQ(Do("lock", "jones", elsewhere.ToChange()).status, 403);
  EXPECT_EQ(Do("lock", "jones", admin.ToChange()).status, 200);
}

TEST_F(AccountApiTest, ListsWhoHasAnAccountAndHowManySessions) {
  LogIn("miller");
  LogIn("miller");
  const HttpResult answer = Get(port(), "/api/v1/accounts", LogIn("root").ToRead());
  const auto accounts = answer.Json()["accounts"];
  ASSERT_EQ(accounts.size(), 3U);
  EXPECT_EQ(accounts[0]["name"], "jones");
  EXPECT_EQ(accounts[0]["sessions"], 0);
  EXPECT_TRUE(accounts[0]["last_log_in"].is_null());
  EXPECT_EQ(accounts[1]["role"], "official");
  EXPECT_EQ(accounts[1]["sessions"], 2);
  EXPECT_FALSE(accounts[1]["last_log_in"].is_null());
  EXPECT_EQ(accounts[1]["locked"], false);
  EXPECT_THAT(answer.body, Not(HasSubstr("argon2")));
}

TEST_F(AccountApiTest, ALockEndsSessionsAndKeepsTheAccountOutUntilItIsUnlocked) {
  const LoggedIn admin = LogIn("root");
  const LoggedIn official = LogIn("miller");
  const HttpResult answer = Do("lock", "miller", admin.ToChange());
  EXPECT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.Json()["locked"], true);
  EXPECT_FALSE(IsLoggedIn(official));
  EXPECT_EQ(TryLogIn("miller").status, 401);
  EXPECT_EQ(Do("unlock", "miller", admin.ToChange()).status, 200);
  EXPECT_FALSE(IsLoggedIn(official)) << "the session of before stays ended";
  EXPECT_EQ(TryLogIn("miller").status, 200);
}

TEST_F(AccountApiTest, EndsSessionsWithoutALock) {
  const LoggedIn admin = LogIn("root");
  const LoggedIn first = LogIn("miller");
  const LoggedIn second = LogIn("miller");
  EXPECT_EQ(Do("end_sessions", "miller", admin.ToChange()).Json()["ended"], 2);
  EXPECT_FALSE(IsLoggedIn(first));
  EXPECT_FALSE(IsLoggedIn(second));
  EXPECT_TRUE(IsLoggedIn(admin));
  EXPECT_EQ(TryLogIn("miller").status, 200);
}

TEST_F(AccountApiTest, AnAddedAccountLogsInAndCanBeRemovedAgain) {
  const LoggedIn admin = LogIn("root");
  const nlohmann::json anna{{"name", "anna"}, {"role", "viewer"}, {"password", kSamePassword}};
  EXPECT_EQ(Change("add", anna, admin.ToChange()).status, 200);
  const LoggedIn viewer = LogIn("anna");
  EXPECT_TRUE(IsLoggedIn(viewer));
  EXPECT_EQ(Change("add", anna, admin.ToChange()).status, 409) << "there already";
  EXPECT_EQ(Do("remove", "anna", admin.ToChange()).status, 200);
  EXPECT_FALSE(IsLoggedIn(viewer));
  EXPECT_EQ(TryLogIn("anna").status, 401);
  EXPECT_EQ(Do("remove", "anna", admin.ToChange()).status, 404);
}

TEST_F(AccountApiTest, ARoleHoldsAtOnce) {
  const LoggedIn admin = LogIn("root");
  const LoggedIn official = LogIn("miller");
  EXPECT_EQ(Change("role", {{"name", "miller"}, {"role", "admin"}}, admin.ToChange()).status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/accounts", official.ToRead()).status, 200);
  EXPECT_EQ(Change("role", {{"name", "miller"}, {"role", "viewer"}}, admin.ToChange()).status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/accounts", official.ToRead()).status, 403);
}

TEST_F(AccountApiTest, ANewPasswordEndsSessionsAndTheOldOneIsWrong) {
  const LoggedIn admin = LogIn("root");
  const LoggedIn official = LogIn("miller");
  const nlohmann::json body{{"name", "miller"}, {"password", "staple battery horse"}};
  EXPECT_EQ(Change("password", body, admin.ToChange()).status, 200);
  EXPECT_FALSE(IsLoggedIn(official));
  EXPECT_EQ(TryLogIn("miller").status, 401);
  EXPECT_EQ(TryLogIn("miller", "staple battery horse").status, 200);
}

TEST_F(AccountApiTest, NamesAndPasswordsThatTheStoreRefusesAreSaid) {
  const LoggedIn admin = LogIn("root");
  const HttpResult blank =
      Change("add", {{"name", " anna"}, {"role", "viewer"}, {"password", kSamePassword}},
             admin.ToChange());
  EXPECT_EQ(blank.status, 400);
  EXPECT_THAT(blank.body, HasSubstr("the name is not accepted"));
  const HttpResult quick =
      Change("password", {{"name", "miller"}, {"password", "short"}}, admin.ToChange());
  EXPECT_EQ(quick.status, 400);
  EXPECT_THAT(quick.body, HasSubstr("accepted are 12 to 256 bytes"));
  EXPECT_EQ(TryLogIn("miller").status, 200) << "nothing was changed";
}

TEST_F(AccountApiTest, OneAdminChangesAccountsOnlySoFast) {
  const LoggedIn admin = LogIn("root");
  int done = 0;
  HttpResult answer;
  for (int i = 0; i < 2 * AccountApi::kMaxChanges; ++i) {
    answer = Do("end_sessions", "jones", admin.ToChange());
    if (answer.status != 200) break;
    ++done;
  }
  EXPECT_GE(done, AccountApi::kMaxChanges);
  EXPECT_EQ(answer.status, 429);
  EXPECT_EQ(answer.Field("Retry-After"), "60");
}

TEST_F(AccountApiTest, TheTrailSaysWhoLoggedInWhoFailedAndWhatAdminsDid) {
  TryLogIn("miller", "a wrong password");
  TryLogIn("my secret passphrase", "miller");
  const LoggedIn admin = LogIn("root");
  Do("lock", "miller", admin.ToChange());
  Request(port(), "DELETE", "/api/v1/session", admin.ToChange());
  const HttpResult answer = Get(port(), "/api/v1/accounts/events", LogIn("root").ToRead());
  const auto events = answer.Json()["events"];
  ASSERT_EQ(events.size(), 6U) << answer.body;
  const auto told = [&](std::size_t i) {
    return events[i]["event"].get<std::string>() + " " + events[i]["name"].get<std::string>() +
           " by " + events[i]["by"].get<std::string>();
  };
  EXPECT_EQ(told(0), "log_in root by root");
  EXPECT_EQ(told(1), "log_out root by root");
  EXPECT_EQ(told(2), "lock miller by root");
  EXPECT_EQ(told(3), "log_in root by root");
  EXPECT_EQ(told(4), "wrong_password  by ");
  EXPECT_EQ(told(5), "wrong_password miller by miller");
  EXPECT_EQ(events[5]["client"], "127.0.0.1");
  EXPECT_THAT(answer.body, Not(HasSubstr("secret passphrase"))) << "a password in the wrong field";
  EXPECT_TRUE(answer.Json()["next"].is_null());
  const auto page = Get(port(), "/api/v1/accounts/events?limit=2&before=4", LogIn("root").ToRead());
  ASSERT_EQ(page.Json()["events"].size(), 2U) << page.body;
  EXPECT_EQ(page.Json()["events"][0]["id"], 3);
  EXPECT_EQ(page.Json()["next"], 2);
}

TEST_F(AccountApiTest, TheTrailSaysWhatBecameOfAccounts) {
  const LoggedIn admin = LogIn("root");
  Change("add", {{"name", "anna"}, {"role", "viewer"}, {"password", kSamePassword}},
         admin.ToChange());
  Change("role", {{"name", "anna"}, {"role", "official"}}, admin.ToChange());
  Change("password", {{"name", "anna"}, {"password", "staple battery horse"}}, admin.ToChange());
  Do("remove", "anna", admin.ToChange());
  const HttpResult answer = Get(port(), "/api/v1/accounts/events?limit=4", admin.ToRead());
  const auto events = answer.Json()["events"];
  ASSERT_EQ(events.size(), 4U) << answer.body;
  const std::vector<std::pair<std::string, std::string>> expected{
      {"remove", ""}, {"set_password", ""}, {"role", "official"}, {"add", "viewer"}};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(events[i]["event"], expected[i].first);
    EXPECT_EQ(events[i]["name"], "anna");
    EXPECT_EQ(events[i]["by"], "root");
    EXPECT_EQ(events[i]["role"].is_null() ? "" : events[i]["role"].get<std::string>(),
              expected[i].second);
  }
  EXPECT_THAT(answer.body, Not(HasSubstr("staple")));
}

TEST_F(AccountApiTest, RefusesWhatItDoesNotKnow) {
  const LoggedIn admin = LogIn("root");
  EXPECT_EQ(Do("lock", "nobody", admin.ToChange()).status, 404);
  EXPECT_EQ(Do("lock", "root", admin.ToChange()).status, 409) << "the own account";
  EXPECT_EQ(Do("remove", "root", admin.ToChange()).status, 409) << "the own account";
  EXPECT_EQ(Change("role", {{"name", "root"}, {"role", "viewer"}}, admin.ToChange()).status, 409);
  EXPECT_EQ(Do("explode", "jones", admin.ToChange()).status, 404);
  EXPECT_EQ(Get(port(), "/api/v1/accounts/lock", admin.ToRead()).status, 405);
  EXPECT_EQ(Do("", "jones", admin.ToChange()).status, 404);
  EXPECT_EQ(Request(port(), "POST", "/api/v1/accounts", admin.ToChange(), "{}").status, 405);
  for (const char* body : {"", "[]", "{}", R"({"name": 1})", R"({"name": "a", "b": 1})"}) {
    EXPECT_EQ(Request(port(), "POST", "/api/v1/accounts/lock", admin.ToChange(), body).status, 400)
        << body;
  }
  EXPECT_EQ(Get(port(), "/api/v1/accounts?limit=1", admin.ToRead()).status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/accounts/events?hazard=1", admin.ToRead()).status, 400);
}

}  // namespace
}  // namespace livemap::web
