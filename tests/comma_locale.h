#pragma once

#include <clocale>
#include <cstdlib>
#include <locale>
#include <stdexcept>
#include <string>

namespace sinew {

/// One half is 0,5 and ten thousand 10.000.
class CommaPunctuation : public std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

/// While it lives, C and C++ write one half as 0,5 (de_DE.UTF-8, made by the build in SINEW_LOCALE_DIR).
/// Throws std::runtime_error where that locale cannot be had: a test must not pass for lack of a comma.
class CommaLocale {
 public:
  CommaLocale() : cpp_before_(std::locale()) {
    setenv("LOCPATH", SINEW_LOCALE_DIR, 1);
    if (std::setlocale(LC_ALL, "de_DE.UTF-8") == nullptr || *std::localeconv()->decimal_point != ',') {
      throw std::runtime_error("no locale de_DE.UTF-8 in " SINEW_LOCALE_DIR);
    }
    std::locale::global(std::locale(std::locale::classic(), new CommaPunctuation));
    std::setlocale(LC_ALL, "de_DE.UTF-8");  // a nameless C++ locale may have reset C's
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
