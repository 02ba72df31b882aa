#pragma once

#include <cstddef>
#include <string>

namespace livemap::accounts {

/// Length of a password, bytes of UTF-8 (NIST SP 800-63B asks for at least 8 and accepts all
/// characters).
constexpr std::size_t kMinPasswordBytes = 12;
constexpr std::size_t kMaxPasswordBytes = 256;

/// Whether somebody may choose it: kMinPasswordBytes to kMaxPasswordBytes bytes of valid UTF-8
/// without control characters.
bool IsAcceptablePassword(const std::string& password);

/// The argon2id hash of a password with a random salt of 16 bytes, in the PHC string format
/// ("$argon2id$v=19$m=65536,t=3,p=4$SALT$HASH"). The parameters are those of RFC 9106, section 4,
/// for machines with little memory: 64 MiB, 3 passes, 4 lanes, which one thread fills here in about
/// 0.15 s. Throws Error when the system has no memory or no randomness for it.
std::string HashPassword(const std::string& password);

/// Whether `hash` was made of this password; false also where it is no such hash. Takes as long as
/// HashPassword.
bool IsPasswordOf(const std::string& password, const std::string& hash);

/// A hash of no password that is known: what is compared where there is no account, so that the
/// time an answer takes tells nobody whether there is one.
constexpr char kNobodysHash[] =
    "$argon2id$v=19$m=65536,t=3,p=4$bGl2ZW1hcGxpdmVtYXBsaQ$"
    "AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";

/// `bytes` random bytes of the system as lower-case hexadecimal digits. Throws Error when there are
/// none.
std::string RandomHex(std::size_t bytes);

}  // namespace livemap::accounts
