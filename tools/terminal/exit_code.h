#pragma once

/// Exit codes of the command; the same for every subcommand.
namespace sinew::tools::exit_code {

inline constexpr int kDone = 0;           ///< done, perhaps with warnings.
inline constexpr int kInternalError = 1;  ///< always a bug.
inline constexpr int kUsage = 2;          ///< a flag or a key of the scene is wrong.
inline constexpr int kInput = 3;          ///< an input file is wrong.
inline constexpr int kNumerical = 4;      ///< the numerics failed, or a gate refused the result.
inline constexpr int kIo = 5;             ///< reading or writing failed.
inline constexpr int kLimit = 6;          ///< a limit was reached: memory, time, counts.
inline constexpr int kBusy = 7;           ///< the output holds another run or is in use.
inline constexpr int kCheck = 8;          ///< a comparison or a check did not hold.
inline constexpr int kSignalBase = 128;   ///< plus the signal's number: 130 SIGINT, 143 SIGTERM.

}  // namespace sinew::tools::exit_code
