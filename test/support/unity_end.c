/* The end of every Unity program: tv_add_test makes the tests call these two functions instead
   of Unity's functions of nearly the same names. Unity's exit status is the number of failures,
   so a program whose tests were all ignored would count as passed. Here a program in which a
   test was ignored and none failed prints the ignored tests' names and exits with
   TWOVIEW_SKIP_CODE. */
#include <unity.h>

enum { MAX_NAMES = 64 };

static const char *ignored[MAX_NAMES];
static UNITY_UINT num_ignored;

void tv_UnityDefaultTestRun(UnityTestFunction test, const char *name, const int line) {
  const UNITY_UINT before = Unity.TestIgnores;
  UnityDefaultTestRun(test, name, line);
  if (Unity.TestIgnores == before) return;
  if (num_ignored < MAX_NAMES) ignored[num_ignored] = name;
  ++num_ignored;
}

int tv_UnityEnd(void) {
  const int failures = UnityEnd();
  UNITY_UINT k;
  if (failures != 0 || Unity.TestIgnores == 0) return failures;
  UnityPrint("skipped (their lines above say why):");
  for (k = 0; k < num_ignored && k < MAX_NAMES; ++k) {
    UnityPrint(" ");
    UnityPrint(ignored[k]);
  }
  UNITY_PRINT_EOL();
  UNITY_OUTPUT_FLUSH();
  return TWOVIEW_SKIP_CODE;
}
