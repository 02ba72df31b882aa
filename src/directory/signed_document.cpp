#include "directory/signed_document.h"

#include <openssl/bio.h>
#include <openssl/cms.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509_vfy.h>

#include <array>
#include <ctime>
#include <memory>

#include "common/error.h"

namespace livemap::directory {
namespace {

constexpr std::size_t kMaxCertificateBytes = 64 << 10;

template <auto free>
struct OpenSslDelete {
  template <typename Type>
  void operator()(Type* object) const {
    free(object);
  }
};
using BioHandle = std::unique_ptr<BIO, OpenSslDelete<BIO_free_all>>;
using CmsHandle = std::unique_ptr<CMS_ContentInfo, OpenSslDelete<CMS_ContentInfo_free>>;
using CertificateHandle = std::unique_ptr<X509, OpenSslDelete<X509_free>>;
using StoreHandle = std::unique_ptr<X509_STORE, OpenSslDelete<X509_STORE_free>>;

/// Of the stack of certificates alone: who owns them is the document.
void FreeSigners(STACK_OF(X509) * signers) { sk_X509_free(signers); }
using SignersHandle = std::unique_ptr<STACK_OF(X509), OpenSslDelete<FreeSigners>>;

template <typename Handle>
Handle Made(typename Handle::pointer object) {
  if (object == nullptr) throw Error("OpenSSL has no memory");
  return Handle(object);
}

BioHandle ReadingBio(const std::string& bytes) {
  return Made<BioHandle>(BIO_new_mem_buf(bytes.data(), static_cast<int>(bytes.size())));
}

std::string BytesOf(BIO& bio) {
  const char* data = nullptr;
  const auto size = BIO_get_mem_data(&bio, &data);
  return {data, static_cast<std::size_t>(size)};
}

/// The words of OpenSSL for what failed last, and forgets them.
std::string TakeOpenSslReason() {
  const unsigned long code = ERR_peek_last_error();
  ERR_clear_error();
  const char* const reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  return reason == nullptr ? "no reason is known" : reason;
}

/// The document; the whole of `bytes` has to be one.
CmsHandle ParseSignedData(const std::string& bytes, const std::string& name) {
  const BioHandle source = ReadingBio(bytes);
  CmsHandle document(d2i_CMS_bio(source.get(), nullptr));
  ERR_clear_error();
  const bool is_signed = document && OBJ_obj2nid(CMS_get0_type(document.get())) == NID_pkcs7_signed;
  if (!is_signed || BIO_pending(source.get()) != 0) {
    throw Error("'" + name + "' is no signed document, accepted is CMS SignedData in DER");
  }
  if (CMS_get0_content(document.get()) == nullptr || *CMS_get0_content(document.get()) == nullptr) {
    throw Error("'" + name + "' has a signature and no content, accepted is one with both");
  }
  return document;
}

StoreHandle StoreOf(const TrustedAuthority& authority, std::optional<std::int64_t> now_ns) {
  const auto* data = reinterpret_cast<const unsigned char*>(authority.certificate().data());
  const CertificateHandle root = Made<CertificateHandle>(
      d2i_X509(nullptr, &data, static_cast<long>(authority.certificate().size())));
  StoreHandle store = Made<StoreHandle>(X509_STORE_new());
  if (X509_STORE_add_cert(store.get(), root.get()) != 1) throw Error("OpenSSL has no memory");
  X509_VERIFY_PARAM* const rules = X509_STORE_get0_param(store.get());
  if (now_ns) {
    X509_VERIFY_PARAM_set_time(rules, static_cast<std::time_t>(*now_ns / 1'000'000'000));
  } else {
    X509_VERIFY_PARAM_set_flags(rules, X509_V_FLAG_NO_CHECK_TIME);
  }
  X509_VERIFY_PARAM_set_purpose(rules, X509_PURPOSE_SMIME_SIGN);
  X509_VERIFY_PARAM_set_depth(rules, 0);  // Nobody between the authority and the signer.
  return store;
}

/// The only signer's common name; empty where it is none or not the only one.
std::string SignerOf(CMS_ContentInfo& document) {
  const SignersHandle signers(CMS_get0_signers(&document));
  if (!signers || sk_X509_num(signers.get()) != 1) return "";
  X509_NAME* const subject = X509_get_subject_name(sk_X509_value(signers.get(), 0));
  std::array<char, 128> text{};
  const int size = X509_NAME_get_text_by_NID(subject, NID_commonName, text.data(),
                                             static_cast<int>(text.size()));
  // A name with a zero byte in it is not what it looks like.
  if (size < 0 || std::string(text.data()).size() != static_cast<std::size_t>(size)) return "";
  return text.data();
}

}  // namespace

TrustedAuthority TrustedAuthority::Read(const std::string& path) {
  const std::string pem = ReadFile(path, kMaxCertificateBytes);
  const BioHandle source = ReadingBio(pem);
  const CertificateHandle certificate(PEM_read_bio_X509(source.get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  if (!certificate) {
    throw Error("'" + path + "' holds no certificate in PEM, accepted is an authority's ca.pem");
  }
  const BioHandle written = Made<BioHandle>(BIO_new(BIO_s_mem()));
  if (i2d_X509_bio(written.get(), certificate.get()) != 1) throw Error("OpenSSL has no memory");
  TrustedAuthority authority;
  authority.certificate_ = BytesOf(*written);
  return authority;
}

std::string OpenSignedDocument(const std::string& bytes, const TrustedAuthority& authority,
                               const std::string& signer, std::optional<std::int64_t> now_ns,
                               std::size_t max_bytes, const std::string& name) {
  if (bytes.size() > max_bytes) {
    throw Error("'" + name + "' has " + std::to_string(bytes.size()) +
                " bytes, accepted are at most " + std::to_string(max_bytes));
  }
  const CmsHandle document = ParseSignedData(bytes, name);
  const StoreHandle store = StoreOf(authority, now_ns);
  const BioHandle content = Made<BioHandle>(BIO_new(BIO_s_mem()));
  ERR_clear_error();
  if (CMS_verify(document.get(), nullptr, store.get(), nullptr, content.get(), CMS_BINARY) != 1) {
    throw Error("'" + name + "' is not signed by the authority: " + TakeOpenSslReason());
  }
  const std::string by = SignerOf(*document);
  if (by != signer) {
    throw Error("'" + name + "' is signed by " + (by.empty() ? "no single name" : "'" + by + "'") +
                ", accepted is '" + signer + "'");
  }
  return BytesOf(*content);
}

}  // namespace livemap::directory
