/* Writes a page: page.html, in which each {{NAME}} is replaced by a part of the page. */
#include <string.h>

#include "page.h"
#include "report/files.h"
#include "sdm/internal/file.h"

typedef struct page_file {
    const char *name, *content;
    size_t size;
} page_file;

static const page_file files[] = {
#include <page_files.inc> // made by page/CMakeLists.txt
#include <page_scripts.inc>
};
enum { N_FILES = sizeof files / sizeof *files };

#ifdef SDM_HAVE_PAGE_RUNTIME
static const page_file runtime[] = {
#include <page_runtime.inc>
};
#else
static const page_file runtime[] = {{"", "", 0}};
#endif

bool cli_page_has_runtime(void) { return runtime->size > 0; }

static const page_file *find_file(const char *name)
{
    for (size_t i = 0; i < N_FILES; i++)
        if (!strcmp(files[i].name, name)) return &files[i];
    return NULL;
}

static sdm_status put_base64(sdm_outfile *out, const uint8_t *data, size_t size, sdm_error *err)
{
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < size && !s; i += 3) {
        const size_t n = size - i < 3 ? size - i : 3;
        const uint32_t bits = (uint32_t)data[i] << 16 | (n > 1 ? (uint32_t)data[i + 1] << 8 : 0) |
                              (n > 2 ? (uint32_t)data[i + 2] : 0);
        const char text[4] = {digit[bits >> 18], digit[bits >> 12 & 63],
                              n > 1 ? digit[bits >> 6 & 63] : '=', n > 2 ? digit[bits & 63] : '='};
        s = sdm_outfile_write(out, text, sizeof text, err);
    }
    return s;
}

/* Writes a text with `<`, `>` and `&` replaced: as HTML by entities, or as JSON by \u escapes. So
 * no name can end the element that holds the text. */
static sdm_status put_escaped(sdm_outfile *out, const char *text, bool json, sdm_error *err)
{
    sdm_status s = SDM_OK;
    while (*text && !s) {
        const size_t n = strcspn(text, "<>&");
        s = sdm_outfile_write(out, text, n, err);
        text += n;
        if (!*text || s) break;
        const char *by_json = *text == '<'   ? "\\u003c"
                              : *text == '>' ? "\\u003e"
                                             : "\\u0026",
                   *by_html = *text == '<'   ? "&lt;"
                              : *text == '>' ? "&gt;"
                                             : "&amp;";
        const char *by = json ? by_json : by_html;
        s = sdm_outfile_write(out, by, strlen(by), err);
        text++;
    }
    return s;
}

static sdm_status put_figures(sdm_outfile *out, const cli_page *page, sdm_error *err)
{
    sdm_json json = {0};
    cli_page_figures(page, &json);
    const sdm_status s = json.text.failed ? sdm_fail(err, SDM_E_NOMEM, "page: out of memory")
                                          : put_escaped(out, json.text.data, true, err);
    sdm_json_dispose(&json);
    return s;
}

/* Writes the part of the page with this name: the name of one of the files, or one of those
 * below. */
static sdm_status put_part(sdm_outfile *out, const cli_page *page, const char *name, sdm_error *err)
{
    const page_file *file = find_file(name);
    if (file && cli_ends_with(name, ".gz"))
        return put_base64(out, (const uint8_t *)file->content, file->size, err);
    if (file) return sdm_outfile_write(out, file->content, file->size, err);
    if (!strcmp(name, "title")) return put_escaped(out, page->info->shape, false, err);
    if (!strcmp(name, "figures")) return put_figures(out, page, err);
    if (!strcmp(name, "runtime"))
        return page->model ? put_base64(out, (const uint8_t *)runtime->content, runtime->size, err)
                           : SDM_OK;
    if (!strcmp(name, "model"))
        return page->model ? put_base64(out, page->model, page->info->file_bytes, err) : SDM_OK;
    if (!strcmp(name, "fit"))
        return page->fit ? put_base64(out, page->fit->bytes, page->fit->size, err) : SDM_OK;
    if (!strcmp(name, "still"))
        return page->model ? SDM_OK : put_base64(out, page->still->bytes, page->still->size, err);
    return sdm_fail(err, SDM_E_ARG, "page.html: no part '%s'", name);
}

static sdm_status put_page(sdm_outfile *out, const cli_page *page, sdm_error *err)
{
    const char *text = find_file("page.html")->content;
    sdm_status s = SDM_OK;
    for (const char *at; !s && (at = strstr(text, "{{"));) {
        char name[64] = "";
        const size_t length = strcspn(at + 2, "}");
        if (length < sizeof name) memcpy(name, at + 2, length);
        s = sdm_outfile_write(out, text, (size_t)(at - text), err);
        if (!s) s = put_part(out, page, name, err);
        text = at + 2 + length + 2;
    }
    return s ? s : sdm_outfile_write(out, text, strlen(text), err);
}

sdm_status cli_page_write(const cli_page *page, const char *path, sdm_error *err)
{
    sdm_outfile *out = NULL;
    sdm_status s = sdm_outfile_open(path, &out, err);
    if (!s) s = put_page(out, page, err);
    if (!s) return sdm_outfile_commit(&out, err);
    sdm_outfile_discard(&out);
    return s;
}
