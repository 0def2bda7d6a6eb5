/* Defines the table TVK_TABLE of a set; kernels/kernels_impl.h says how to include this file. A set
   with several tables includes it again with another TVK_TABLE. */
#define TVK_DECLARE(name, result, parameters) \
  result tvk_##name##_c parameters;           \
  result tvk_##name##_avx2 parameters;
TVK_PIXEL_LIST(TVK_DECLARE)
#undef TVK_DECLARE

#if !defined(TVK_MATCH)
#define TVK_MATCH(name) tvk_##name##_c
#endif
#define TVK_DECLARE(name, result, parameters) result TVK_MATCH(name) parameters;
TVK_MATCH_LIST(TVK_DECLARE)
#undef TVK_DECLARE

extern const tvk_table TVK_TABLE;
const tvk_table TVK_TABLE = {TVK_SET,
#define TVK_ENTRY(name, result, parameters) name,
                             TVK_PIXEL_LIST(TVK_ENTRY)
#undef TVK_ENTRY
#define TVK_ENTRY(name, result, parameters) TVK_MATCH(name),
                                 TVK_MATCH_LIST(TVK_ENTRY)
#undef TVK_ENTRY
};
