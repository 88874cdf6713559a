/* Converts voxels of ten types, in both byte orders, from and to the bytes of a file. */
#include "voxels.h"
#include "bytes.h"

const sdm_voxel_format sdm_voxel_formats[SDM_N_VOXEL_TYPES] = {
    {"uint8", 1, 2, "unsigned char|uchar|uint8", "UCHAR"},
    {"int8", 1, 256, "signed char|int8", "CHAR"},
    {"uint16", 2, 512, "unsigned short|ushort|unsigned short int|uint16", "USHORT"},
    {"int16", 2, 4, "short|short int|signed short|signed short int|int16", "SHORT"},
    {"uint32", 4, 768, "unsigned int|uint|uint32", "UINT|ULONG"},
    {"int32", 4, 8, "int|signed int|int32", "INT|LONG"},
    {"uint64", 8, 1280, "unsigned long long|ulonglong|unsigned long long int|uint64", "ULONG_LONG"},
    {"int64", 8, 1024,
     "long long|longlong|long long int|signed long long|signed long long int|int64", "LONG_LONG"},
    {"float32", 4, 16, "float", "FLOAT"},
    {"float64", 8, 64, "double", "DOUBLE"}};

static bool is_type(sdm_voxel_type type) { return (unsigned)type < SDM_N_VOXEL_TYPES; }

size_t sdm_voxel_size(sdm_voxel_type type)
{
    return is_type(type) ? sdm_voxel_formats[type].size : 0;
}

const char *sdm_voxel_name(sdm_voxel_type type)
{
    return is_type(type) ? sdm_voxel_formats[type].name : "unknown";
}

/* Lower case of an ASCII letter, whatever the locale. */
static char lower(char c) { return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c; }

bool sdm_is_listed(const char *word, const char *list)
{
    const size_t n = strlen(word);
    for (;;) {
        const size_t m = strcspn(list, "|");
        size_t same = 0;
        while (same < n && same < m && lower(word[same]) == lower(list[same])) same++;
        if (m == n && same == n && n > 0) return true;
        if (!list[m]) return false;
        list += m + 1;
    }
}

double sdm_length_unit(const char *name)
{
    static const struct {
        const char *names;
        double mm;
    } units[] = {{"mm|millimeter|millimetre|millimeters", 1},
                 {"um|micron|microns|micrometer|micrometre|\xC2\xB5m", 1e-3},
                 {"cm|centimeter|centimetre", 10},
                 {"m|meter|metre", 1000}};
    for (size_t i = 0; i < sizeof units / sizeof *units; i++)
        if (sdm_is_listed(name, units[i].names)) return units[i].mm;
    return 0;
}

static double decode_voxel(const uint8_t *p, sdm_voxel_type type, bool big)
{
    switch (type) {
    case SDM_VOXEL_UINT8:
        return p[0];
    case SDM_VOXEL_INT8:
        return (int8_t)p[0];
    case SDM_VOXEL_UINT16:
        return (uint16_t)sdm_get_uint(p, 2, big);
    case SDM_VOXEL_INT16:
        return (int16_t)sdm_get_uint(p, 2, big);
    case SDM_VOXEL_UINT32:
        return (uint32_t)sdm_get_uint(p, 4, big);
    case SDM_VOXEL_INT32:
        return (int32_t)sdm_get_uint(p, 4, big);
    case SDM_VOXEL_UINT64:
        return (double)sdm_get_uint(p, 8, big);
    case SDM_VOXEL_INT64:
        return (double)(int64_t)sdm_get_uint(p, 8, big);
    case SDM_VOXEL_FLOAT32:
        return (double)sdm_get_f32(p, big);
    default:
        return sdm_get_f64(p, big);
    }
}

void sdm_voxels_decode(const uint8_t *p, sdm_voxel_type type, bool big, double slope,
                       double intercept, size_t n, float *out)
{
    const size_t size = sdm_voxel_formats[type].size;
    const bool scaled = slope != 1 || intercept != 0;
    for (size_t i = 0; i < n; i++) {
        const double v = decode_voxel(p + size * i, type, big);
        out[i] = (float)(scaled ? slope * v + intercept : v);
    }
}

void sdm_voxels_encode(const void *values, sdm_voxel_type type, size_t first, size_t n, uint8_t *p)
{
    const size_t size = sdm_voxel_formats[type].size;
    const uint8_t *from = (const uint8_t *)values + first * size;
    for (size_t i = 0; i < n; i++, from += size, p += size) {
        uint16_t v16;
        uint32_t v32;
        uint64_t v64;
        switch (size) {
        case 1:
            *p = *from;
            break;
        case 2:
            memcpy(&v16, from, sizeof v16);
            sdm_put_uint(p, 2, v16);
            break;
        case 4:
            memcpy(&v32, from, sizeof v32);
            sdm_put_uint(p, 4, v32);
            break;
        default:
            memcpy(&v64, from, sizeof v64);
            sdm_put_uint(p, 8, v64);
            break;
        }
    }
}
