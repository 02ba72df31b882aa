#include "test/directory/test_authority.h"

#include <openssl/bio.h>
#include <openssl/cms.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include "common/error.h"

namespace livemap::directory {
namespace {

void Require(bool holds) {
  if (!holds) throw Error("OpenSSL refused what a test wants");
}

EVP_PKEY* NewKey() {
  EVP_PKEY* const key = EVP_EC_gen("P-256");
  Require(key != nullptr);
  return key;
}

void AddExtension(X509& certificate, X509& issuer, int nid, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, &issuer, &certificate, nullptr, nullptr, 0);
  X509_EXTENSION* const extension = X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str());
  Require(extension != nullptr && X509_add_ext(&certificate, extension, -1) == 1);
  X509_EXTENSION_free(extension);
}

X509* NewCertificate(const std::string& name, EVP_PKEY* key, std::int64_t from_s,
                     std::int64_t until_s) {
  static long serial = 1;
  X509* const certificate = X509_new();
  X509_set_version(certificate, X509_VERSION_3);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate), serial++);
  ASN1_TIME_set(X509_getm_notBefore(certificate), from_s);
  ASN1_TIME_set(X509_getm_notAfter(certificate), until_s);
  Require(X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate), "CN", MBSTRING_UTF8,
                                     reinterpret_cast<const unsigned char*>(name.data()),
                                     static_cast<int>(name.size()), -1, 0) == 1);
  Require(X509_set_pubkey(certificate, key) == 1);
  return certificate;
}

std::string TakeBytes(BIO* bio) {
  char* data = nullptr;
  const auto size = BIO_get_mem_data(bio, &data);
  std::string bytes(data, static_cast<std::size_t>(size));
  BIO_free_all(bio);
  return bytes;
}

}  // namespace

TestAuthority::TestAuthority() : key_(NewKey()) {
  certificate_ = NewCertificate("LiveMap zone town", key_, 1'735'689'600, 2'051'222'400);
  X509_set_issuer_name(certificate_, X509_get_subject_name(certificate_));
  AddExtension(*certificate_, *certificate_, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  AddExtension(*certificate_, *certificate_, NID_key_usage, "critical,keyCertSign,cRLSign");
  Require(X509_sign(certificate_, key_, EVP_sha256()) > 0);
}

TestAuthority::~TestAuthority() {
  X509_free(certificate_);
  EVP_PKEY_free(key_);
}

std::string TestAuthority::Sign(const std::string& content, const Subject& subject) const {
  EVP_PKEY* const key = NewKey();
  X509* const certificate = NewCertificate(subject.name, key, subject.from_s, subject.until_s);
  X509_set_issuer_name(certificate, X509_get_subject_name(certificate_));
  AddExtension(*certificate, *certificate_, NID_basic_constraints, "critical,CA:FALSE");
  AddExtension(*certificate, *certificate_, NID_key_usage, "critical,digitalSignature");
  AddExtension(*certificate, *certificate_, NID_ext_key_usage, "critical," + subject.purpose);
  Require(X509_sign(certificate, key_, EVP_sha256()) > 0);
  BIO* const source = BIO_new_mem_buf(content.data(), static_cast<int>(content.size()));
  CMS_ContentInfo* const document =
      CMS_sign(certificate, key, nullptr, source, CMS_BINARY | CMS_NOSMIMECAP);
  Require(document != nullptr);
  BIO* const written = BIO_new(BIO_s_mem());
  Require(i2d_CMS_bio(written, document) == 1);
  CMS_ContentInfo_free(document);
  BIO_free_all(source);
  X509_free(certificate);
  EVP_PKEY_free(key);
  return TakeBytes(written);
}

std::string TestAuthority::Pem() const {
  BIO* const written = BIO_new(BIO_s_mem());
  Require(PEM_write_bio_X509(written, certificate_) == 1);
  return TakeBytes(written);
}

std::string DirectoryText(std::uint64_t version, const std::string& issued,
                          const std::string& expires) {
  return R"({"type": "FeatureCollection", "livemap_zone_directory": 1, "authority": "town",)"
         R"("version": )" +
         std::to_string(version) + R"(, "issued": ")" + issued + R"(", "expires": ")" + expires +
         R"(", "features": [{"type": "Feature", "id": "oakland", "geometry": {"type": "Polygon",)"
         R"("coordinates": [[[-79.96, 40.43], [-79.94, 40.43], [-79.94, 40.45], [-79.96, 40.45],)"
         R"([-79.96, 40.43]]]}, "properties": {"name": "Oakland",)"
         R"("brokers": [{"host": "zone.example.org", "port": 8883}]}}]})";
}

}  // namespace livemap::directory
