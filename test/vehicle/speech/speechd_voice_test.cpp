#include "vehicle/speech/speechd_voice.h"

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

#include "common/error.h"
#include "test/support/temporary_directory.h"
#include "vehicle/speech/speech_server.h"

namespace livemap::vehicle {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

bool GoOn() { return false; }

/// A server that accepts, and never says anything.
class SilentServer {
 public:
  SilentServer() : path(folder_.path() + "/speechd.sock"), fd_(socket(AF_UNIX, SOCK_STREAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.data(), path.size());
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    EXPECT_EQ(listen(fd_, 1), 0);
  }
  ~SilentServer() { close(fd_); }

 private:
  test::TemporaryDirectory folder_;

 public:
  const std::string path;

 private:
  const int fd_;
};

TEST(SpeechServer, ThatIsHungOrAbsentIsToldInTime) {
  const SilentServer server;
  EXPECT_EQ(AskSpeechServer(server.path, 0.05, GoOn), SpeechServer::kSilent);
  EXPECT_EQ(AskSpeechServer(server.path, 1000, [] { return true; }), SpeechServer::kSilent);
  EXPECT_EQ(AskSpeechServer(server.path + "x", 0.05, GoOn), SpeechServer::kAbsent);
  EXPECT_EQ(AskSpeechServer(std::string(300, 'x'), 0.05, GoOn), SpeechServer::kAbsent);
}

TEST(SpeechdVoice, DoesNotWaitForAServerThatDoesNotAnswer) {
  const SilentServer server;
  setenv("SPEECHD_ADDRESS", ("unix_socket:" + server.path).c_str(), 1);
  SpeechdVoice::Config config;
  config.answer_timeout_s = 0.05;
  SpeechdVoice voice(config);
  EXPECT_THAT([&] { voice.Open(GoOn); }, ThrowsMessage<Error>(HasSubstr("does not answer")));
  unsetenv("SPEECHD_ADDRESS");
}

}  // namespace
}  // namespace livemap::vehicle
