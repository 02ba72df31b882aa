#include "web/officials/account_body.h"

#include <nlohmann/json.hpp>

#include "web/http/request_target.h"

namespace livemap::web {
namespace {

using accounts::AccountEventKind;

bool HasRole(AccountEventKind action) {
  return action == AccountEventKind::kAdd || action == AccountEventKind::kRole;
}

bool HasPassword(AccountEventKind action) {
  return action == AccountEventKind::kAdd || action == AccountEventKind::kSetPassword;
}

[[noreturn]] void RefuseAccountBody(AccountEventKind action) {
  std::string accepted = "the text name";
  if (HasRole(action)) accepted = "the texts name and role";
  if (HasPassword(action)) accepted = "the texts name and password";
  if (HasRole(action) && HasPassword(action)) accepted = "the texts name, role and password";
  throw BadRequest("the body is not accepted, accepted is an object of " + accepted);
}

}  // namespace

AccountBody ParseAccountBody(AccountEventKind action, const std::string& text) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  const auto take = [&](const char* key) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_string()) RefuseAccountBody(action);
    return found->get<std::string>();
  };
  const std::size_t keys = 1U + (HasRole(action) ? 1U : 0U) + (HasPassword(action) ? 1U : 0U);
  if (!json.is_object() || json.size() != keys) RefuseAccountBody(action);
  AccountBody body;
  body.name = take("name");
  if (HasRole(action)) {
    body.role = accounts::RoleOf(take("role"));
    if (!body.role) {
      throw BadRequest("the role is not accepted, accepted are viewer, official and admin");
    }
  }
  if (HasPassword(action)) body.password = take("password");
  return body;
}

}  // namespace livemap::web
