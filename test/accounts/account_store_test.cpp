#include "accounts/account_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "common/error.h"
#include "common/sqlite.h"

namespace livemap::accounts {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kNow = 1'767'225'600'000'000'000;
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr char kPassword[] = "correct horse battery";

class AccountStoreTest : public testing::Test {
 protected:
  AccountStoreTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "accounts_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw Error("mkdtemp failed");
    folder_ = pattern;
    accounts_ = std::make_unique<AccountStore>(Path(), AccountStore::Config{});
  }
  ~AccountStoreTest() override { std::filesystem::remove_all(folder_); }

  std::string Path() const { return (folder_ / "accounts.sqlite").string(); }
  std::string WhyNotAdded(const std::string& name, const std::string& password) {
    try {
      accounts_->Add(name, Role::kViewer, password, kNow);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
  std::unique_ptr<AccountStore> accounts_;
};

TEST_F(AccountStoreTest, WhoeverKnowsThePasswordIsLetInWithTheRole) {
  EXPECT_FALSE(accounts_->HasAccounts());
  accounts_->Add("miller", Role::kOfficial, kPassword, kNow);
  EXPECT_TRUE(accounts_->HasAccounts());
  const auto person = accounts_->CheckPassword("miller", kPassword);
  ASSERT_TRUE(person);
  EXPECT_EQ(person->name, "miller");
  EXPECT_EQ(person->role, Role::kOfficial);
  EXPECT_FALSE(accounts_->CheckPassword("miller", "correct horse batterz"));
  EXPECT_FALSE(accounts_->CheckPassword("nobody", kPassword));
  EXPECT_FALSE(accounts_->CheckPassword("miller", std::string(100'000, 'a')));
}

TEST_F(AccountStoreTest, TheFileIsItsOwnersAloneAndHasNoPasswordOrTokenInIt) {
  accounts_->Add("miller", Role::kOfficial, kPassword, kNow);
  const std::string token = accounts_->OpenSession("miller", kNow);
  struct stat status {};
  ASSERT_EQ(stat(Path().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600U);
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    std::FILE* file = std::fopen(entry.path().c_str(), "rb");
    ASSERT_NE(file, nullptr);
    std::string bytes(std::filesystem::file_size(entry.path()), '\0');
    ASSERT_EQ(std::fread(bytes.data(), 1, bytes.size(), file), bytes.size());
    std::fclose(file);
    EXPECT_EQ(bytes.find(kPassword), std::string::npos) << entry.path();
    EXPECT_EQ(bytes.find(token), std::string::npos) << entry.path();
  }
}

TEST_F(AccountStoreTest, ASessionLastsForItsTimeAndUntilItIsClosed) {
  accounts_->Add("miller", Role::kOfficial, kPassword, kNow);
  const std::string token = accounts_->OpenSession("miller", kNow);
  const std::string other = accounts_->OpenSession("miller", kNow);
  const auto session_ns = static_cast<std::int64_t>(accounts_->config().session_s * 1e9);
  ASSERT_TRUE(accounts_->FindSession(token, kNow + session_ns - kSecond));
  EXPECT_FALSE(accounts_->FindSession(token, kNow + session_ns));
  EXPECT_FALSE(accounts_->FindSession(std::string(64, '0'), kNow));
  EXPECT_FALSE(accounts_->FindSession("", kNow));
  accounts_->CloseSession(token);
  EXPECT_FALSE(accounts_->FindSession(token, kNow));
  EXPECT_TRUE(accounts_->FindSession(other, kNow)) << "another session of the account was closed";
}

TEST_F(AccountStoreTest, ANewPasswordOrARemovedAccountEndsItsSessions) {
  accounts_->Add("miller", Role::kOfficial, kPassword, kNow);
  accounts_->Add("jones", Role::kViewer, kPassword, kNow);
  const std::string token = accounts_->OpenSession("miller", kNow);
  const std::string kept = accounts_->OpenSession("jones", kNow);
  accounts_->SetPassword("miller", "another good password", kNow);
  EXPECT_FALSE(accounts_->FindSession(token, kNow));
  EXPECT_FALSE(accounts_->CheckPassword("miller", kPassword));
  EXPECT_TRUE(accounts_->CheckPassword("miller", "another good password"));
  const std::string again = accounts_->OpenSession("miller", kNow);
  accounts_->Remove("miller");
  EXPECT_FALSE(accounts_->FindSession(again, kNow));
  EXPECT_TRUE(accounts_->FindSession(kept, kNow));
}

TEST_F(AccountStoreTest, WhatAnotherProgramChangesHoldsAtOnce) {
  accounts_->Add("miller", Role::kViewer, kPassword, kNow);
  const std::string token = accounts_->OpenSession("miller", kNow);
  AccountStore other(Path(), {});
  EXPECT_EQ(other.id(), accounts_->id());
  other.SetRole("miller", Role::kAdmin);
  EXPECT_EQ(accounts_->FindSession(token, kNow)->role, Role::kAdmin);
  other.Remove("miller");
  EXPECT_FALSE(accounts_->FindSession(token, kNow));
  EXPECT_FALSE(accounts_->HasAccounts());
}

TEST_F(AccountStoreTest, TheOldestSessionGoesForOneTooMany) {
  accounts_->Add("miller", Role::kViewer, kPassword, kNow);
  const std::string first = accounts_->OpenSession("miller", kNow);
  for (std::size_t i = 1; i < AccountStore::kMaxSessionsOfOne; ++i) {
    accounts_->OpenSession("miller", kNow + static_cast<std::int64_t>(i) * kSecond);
  }
  EXPECT_TRUE(accounts_->FindSession(first, kNow));
  const std::string last = accounts_->OpenSession("miller", kNow + 100 * kSecond);
  EXPECT_FALSE(accounts_->FindSession(first, kNow));
  EXPECT_TRUE(accounts_->FindSession(last, kNow));
}

TEST_F(AccountStoreTest, RefusesByASentenceWhatCannotBeAnAccount) {
  accounts_->Add("miller", Role::kViewer, kPassword, kNow);
  EXPECT_THAT(WhyNotAdded("miller", kPassword), HasSubstr("already"));
  EXPECT_THAT(WhyNotAdded("", kPassword), HasSubstr("accepted are 1 to 64 bytes"));
  EXPECT_THAT(WhyNotAdded(" jones", kPassword), HasSubstr("without blanks"));
  EXPECT_THAT(WhyNotAdded(std::string(65, 'a'), kPassword), HasSubstr("64"));
  EXPECT_THAT(WhyNotAdded("jones", "short"), HasSubstr("12 to 256"));
  EXPECT_THROW(accounts_->Remove("jones"), Error);
  EXPECT_THROW(accounts_->SetPassword("jones", kPassword, kNow), Error);
  EXPECT_THROW(accounts_->SetRole("jones", Role::kAdmin), Error);
  EXPECT_FALSE(RoleOf("king"));
}

TEST_F(AccountStoreTest, ListsAccountsWithTheirLastLogIn) {
  accounts_->Add("miller", Role::kOfficial, kPassword, kNow);
  accounts_->Add("jones", Role::kAdmin, kPassword, kNow + kSecond);
  accounts_->OpenSession("miller", kNow + 2 * kSecond);
  const auto list = accounts_->List();
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[0].name, "jones");
  EXPECT_EQ(list[0].role, Role::kAdmin);
  EXPECT_FALSE(list[0].last_log_in);
  EXPECT_EQ(list[1].last_log_in, kNow + 2 * kSecond);
}

}  // namespace
}  // namespace livemap::accounts
