// kSanitized tells whether this program is compiled with sanitizers (TWOVIEW_SANITIZE). The
// library's results are the same bits there as in the release build. So a test of many random cases
// takes fewer of them there, enough to run all of the code, and does not judge shares and means of
// so few.
#ifndef TEST_SUPPORT_SANITIZED_H
#define TEST_SUPPORT_SANITIZED_H

#ifdef TWOVIEW_SANITIZED
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

#endif
