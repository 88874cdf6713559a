/* HDF5 files (libhdf5), or a message in builds without it. */
#include "tree.h"

#ifdef SDM_HAVE_HDF5
#include <hdf5.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "sdm/memory.h"

/* zlib, the usual filter, makes at most 1032 bytes of one */
#define RATIO_MAX 1032

static hid_t file_of(const cli_tree *t) { return *(const hid_t *)t->self; }

/* H5Lexists() demands that all groups of the path exist. */
static bool hdf5_has(const cli_tree *t, const char *name)
{
    char part[CLI_TREE_TEXT];
    for (size_t n = 1; strlen(name) < sizeof part && n <= strlen(name); n++) {
        if (name[n] != '/' && name[n] != '\0') continue;
        memcpy(part, name, n);
        part[n] = '\0';
        if (H5Lexists(file_of(t), part, H5P_DEFAULT) <= 0) return false;
    }
    return strlen(name) < sizeof part && H5Oexists_by_name(file_of(t), name, H5P_DEFAULT) > 0;
}

/* The sizes of an open array, checked against what the file holds of it. */
static sdm_status check_array(const cli_tree *t, const char *name, hid_t data, size_t shape[2],
                              int *n_dim, sdm_error *err)
{
    hsize_t sizes[2] = {1, 1};
    const hid_t space = H5Dget_space(data), type = H5Dget_type(data);
    const int rank = H5Sget_simple_extent_ndims(space);
    const H5T_class_t class = H5Tget_class(type);
    const size_t size = H5Tget_size(type);
    const hsize_t stored = H5Dget_storage_size(data);
    if (rank >= 0 && rank <= 2) H5Sget_simple_extent_dims(space, sizes, NULL);
    H5Sclose(space);
    H5Tclose(type);
    if (rank < 0 || rank > 2)
        return sdm_fail(err, SDM_E_FORMAT, "%s: %s has %d dimensions, need one or two", t->path,
                        name, rank);
    if (class != H5T_FLOAT && class != H5T_INTEGER)
        return sdm_fail(err, SDM_E_FORMAT, "%s: %s is no array of numbers", t->path, name);
    if (sizes[0] == 0 || sizes[1] == 0)
        return sdm_fail(err, SDM_E_FORMAT, "%s: %s is empty", t->path, name);
    if (sizes[0] > RATIO_MAX * (stored + 1) / size ||
        sizes[1] > RATIO_MAX * (stored + 1) / size / sizes[0])
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: %s: %llu x %llu numbers, but only %llu bytes stored", t->path, name,
                        (unsigned long long)sizes[0], (unsigned long long)sizes[1],
                        (unsigned long long)stored);
    shape[0] = (size_t)sizes[0], shape[1] = (size_t)sizes[1];
    *n_dim = rank;
    return SDM_OK;
}

static sdm_status hdf5_numbers(const cli_tree *t, const char *name, double **values,
                               size_t shape[2], int *n_dim, sdm_error *err)
{
    *values = NULL;
    const hid_t data = hdf5_has(t, name) ? H5Dopen2(file_of(t), name, H5P_DEFAULT) : -1;
    if (data < 0) return sdm_fail(err, SDM_E_FORMAT, "%s: no array %s", t->path, name);
    sdm_status s = check_array(t, name, data, shape, n_dim, err);
    if (!s) s = SDM_ALLOC(values, shape[0] * shape[1], "numbers of a shape model", err);
    if (!s && H5Dread(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, *values) < 0)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: %s cannot be read: damaged, or incomplete", t->path,
                     name);
    H5Dclose(data);
    if (!s) return SDM_OK;
    sdm_free(*values);
    *values = NULL;
    return s;
}

/* Copies a string of fixed or variable length that `read` reads from `object`. */
static bool read_string(hid_t object, hid_t type, hid_t space, bool is_attribute,
                        char out[CLI_TREE_TEXT])
{
    bool ok = H5Tget_class(type) == H5T_STRING && H5Sget_simple_extent_npoints(space) == 1;
    const size_t size = H5Tget_size(type);
    if (ok && H5Tis_variable_str(type) > 0) {
        char *text = NULL;
        const hid_t memory = H5Tcopy(type);
        ok = (is_attribute ? H5Aread(object, memory, &text)
                           : H5Dread(object, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, &text)) >= 0 &&
             text;
        if (ok) snprintf(out, CLI_TREE_TEXT, "%s", text);
        if (text) H5free_memory(text);
        H5Tclose(memory);
    } else if (ok) {
        ok = size < CLI_TREE_TEXT;
        memset(out, 0, CLI_TREE_TEXT);
        if (ok)
            ok = (is_attribute ? H5Aread(object, type, out)
                               : H5Dread(object, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, out)) >= 0;
    }
    return ok;
}

static bool hdf5_text(const cli_tree *t, const char *name, const char *attribute,
                      char out[CLI_TREE_TEXT])
{
    if (!hdf5_has(t, name)) return false;
    const hid_t object =
        attribute ? H5Aopen_by_name(file_of(t), name, attribute, H5P_DEFAULT, H5P_DEFAULT)
                  : H5Dopen2(file_of(t), name, H5P_DEFAULT);
    if (object < 0) return false;
    const hid_t type = attribute ? H5Aget_type(object) : H5Dget_type(object),
                space = attribute ? H5Aget_space(object) : H5Dget_space(object);
    const bool ok = read_string(object, type, space, attribute != NULL, out);
    H5Tclose(type);
    H5Sclose(space);
    if (attribute)
        H5Aclose(object);
    else
        H5Dclose(object);
    return ok;
}

static bool hdf5_child(const cli_tree *t, const char *group, size_t index, char out[CLI_TREE_TEXT])
{
    H5G_info_t info;
    if (!hdf5_has(t, group) || H5Gget_info_by_name(file_of(t), group, &info, H5P_DEFAULT) < 0 ||
        index >= info.nlinks)
        return false;
    return H5Lget_name_by_idx(file_of(t), group, H5_INDEX_NAME, H5_ITER_INC, index, out,
                              CLI_TREE_TEXT, H5P_DEFAULT) >= 0;
}

static void hdf5_close(cli_tree *t)
{
    H5Fclose(file_of(t));
    sdm_free(t->self);
    *t = (cli_tree){0};
}

sdm_status cli_tree_hdf5(const char *path, cli_tree *tree, sdm_error *err)
{
    hid_t *file = NULL;
    FILE *probe = fopen(path, "rb");
    if (!probe) return sdm_fail(err, SDM_E_IO, "%s: cannot be opened", path);
    fclose(probe);
    const sdm_status s = SDM_ALLOC(&file, 1, "HDF5 file", err);
    if (s) return s;
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // the library would print
    *file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    if (*file < 0) {
        sdm_free(file);
        return sdm_fail(err, SDM_E_FORMAT, "%s: not an HDF5 file, or cut off", path);
    }
    *tree = (cli_tree){path, file, hdf5_numbers, hdf5_has, hdf5_text, hdf5_child, hdf5_close};
    return SDM_OK;
}
#else
sdm_status cli_tree_hdf5(const char *path, cli_tree *tree, sdm_error *err)
{
    (void)tree;
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "%s: built without HDF5: install libhdf5-dev and configure with -DSDM_HDF5=ON, "
                    "or save the model as .h5.json",
                    path);
}
#endif
