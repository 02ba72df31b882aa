#pragma once

#include <optional>
#include <string>

#include "accounts/account_store.h"

namespace livemap::web {

/// What an admin asks to be done to an account.
struct AccountBody {
  std::string name;
  std::optional<accounts::Role> role;  ///< Of kAdd and kRole alone.
  std::string password;                ///< Of kAdd and kSetPassword alone.
};

/// Reads the body of a request for `action`, one that an admin can ask for. It is a JSON object
/// with exactly the texts that the action needs. Throws BadRequest that says which these are.
/// Whether name and password are accepted says the account store.
///
/// Typical usage:
///   const AccountBody body = ParseAccountBody(accounts::AccountEventKind::kRole, question.body);
///   store.SetRole(body.name, *body.role);
AccountBody ParseAccountBody(accounts::AccountEventKind action, const std::string& text);

}  // namespace livemap::web
