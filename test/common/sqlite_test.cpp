#include "common/sqlite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace livemap {
namespace {

class SqliteTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = std::filesystem::path(::testing::TempDir()) /
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  std::string Path() const { return (directory_ / "test.sqlite").string(); }

  std::filesystem::path directory_;
};

TEST_F(SqliteTest, CommittedRowsAreThereAfterReopening) {
  {
    SqliteDatabase database(Path(), true);
    database.Migrate({"CREATE TABLE t(id INTEGER, name TEXT, data BLOB)"});
    const std::uint8_t bytes[] = {0, 1, 255};
    database.Prepare("INSERT INTO t VALUES(?, ?, ?)")
        .Bind(1, std::int64_t{7})
        .Bind(2, std::string("o'neil\0x", 8))
        .BindBlob(3, bytes, sizeof(bytes))
        .Execute();
  }
  SqliteDatabase database(Path(), true);
  SqliteStatement query = database.Prepare("SELECT id, name, data FROM t");
  ASSERT_TRUE(query.Step());
  EXPECT_EQ(query.Int(0), 7);
  EXPECT_EQ(query.Text(1), std::string("o'neil\0x", 8));
  EXPECT_THAT(query.Blob(2), ::testing::ElementsAre(0, 1, 255));
  EXPECT_FALSE(query.Step());
}

TEST_F(SqliteTest, AThrowingTransactionLeavesNothingBehind) {
  SqliteDatabase database(Path(), true);
  database.Execute("CREATE TABLE t(id INTEGER)");
  EXPECT_THROW(database.Transaction([&] {
    database.Execute("INSERT INTO t VALUES(1)");
    throw std::runtime_error("stop");
  }),
               std::runtime_error);
  SqliteStatement query = database.Prepare("SELECT count(*) FROM t");
  ASSERT_TRUE(query.Step());
  EXPECT_EQ(query.Int(0), 0);
}

TEST_F(SqliteTest, MigrationsRunOnceAndANewerFileIsRefused) {
  const std::vector<std::string> two = {"CREATE TABLE a(x)", "CREATE TABLE b(x)"};
  SqliteDatabase(Path(), true).Migrate({two[0]});
  SqliteDatabase(Path(), true).Migrate(two);
  SqliteDatabase(Path(), true).Migrate(two);
  SqliteDatabase database(Path(), true);
  EXPECT_THROW(database.Migrate({two[0]}), StoreError);
}

TEST_F(SqliteTest, AFileThatIsNoDatabaseIsAnErrorThatNamesIt) {
  std::ofstream(Path()) << std::string(5000, 'x');
  try {
    SqliteDatabase database(Path(), true);
    FAIL() << "expected a StoreError";
  } catch (const StoreError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(Path()));
  }
}

}  // namespace
}  // namespace livemap
