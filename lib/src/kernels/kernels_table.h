/* Defines the tables of a set's parts: TVK_TABLE(part) is the name of a part's;
   kernels/kernels_impl.h says how to include this file. */
#define TVK_DECLARE(name, result, parameters) \
  result tvk_##name##_c parameters;           \
  result tvk_##name##_avx2 parameters;
#define TVK_DECLARE_PART(part, LIST) LIST(TVK_DECLARE)
TVK_PIXEL_PARTS(TVK_DECLARE_PART)
#undef TVK_DECLARE_PART
#undef TVK_DECLARE

#define TVK_ENTRY(name, result, parameters) name,
#define TVK_DEFINE_PART(part, LIST)                \
  extern const tvk_##part##_table TVK_TABLE(part); \
  const tvk_##part##_table TVK_TABLE(part) = {LIST(TVK_ENTRY)};
TVK_PIXEL_PARTS(TVK_DEFINE_PART)
#undef TVK_DEFINE_PART
#undef TVK_ENTRY
