#pragma once

#include <clocale>
#include <cstdlib>
#include <locale>
#include <stdexcept>
#include <string>

namespace sinew {

/// While it lives, C and C++ write one half as 0,5 (de_DE.UTF-8, made by the build in SINEW_LOCALE_DIR).
/// Throws std::runtime_error where that locale cannot be had: a test must not pass for lack of a comma.
class CommaLocale {
 public:
  CommaLocale() : cpp_before_(std::locale()) {
    setenv("LOCPATH", SINEW_LOCALE_DIR, 1);
    if (std::setlocale(LC_ALL, "de_DE.UTF-8") == nullptr || *std::localeconv()->decimal_point != ',') {
      throw std::runtime_error("no locale de_DE.UTF-8 in " SINEW_LOCALE_DIR);
    }
    std::locale::global(std::locale("de_DE.UTF-8"));
  }
  ~CommaLocale() {
    std::locale::global(cpp_before_);
    std::setlocale(LC_ALL, "C");
  }
  CommaLocale(const CommaLocale&) = delete;
  CommaLocale& operator=(const CommaLocale&) = delete;

 private:
  std::locale cpp_before_;
};

}  // namespace sinew
