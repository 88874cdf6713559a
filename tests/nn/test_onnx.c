/* Messages in the encoding of Protocol Buffers against bytes that its specification gives, and the
 * limit of 2 GB. tests/cli/export_onnx.sh reads whole files.
 * Tests: onnx_file.c onnx_graph.c protobuf.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "onnx/onnx.h"

static void expect_bytes(sdm_proto *p, const char *bytes, size_t size)
{
    assert_false(p->failed);
    assert_int_equal(p->size, size);
    assert_memory_equal(p->data, bytes, size);
    sdm_proto_dispose(p);
}

/* The examples of protobuf.dev/programming-guides/encoding, and a negative integer. */
static void test_fields(void **state)
{
    (void)state;
    sdm_proto p = {0}, inner = {0};
    sdm_proto_int(&p, 1, 150);
    expect_bytes(&p, "\x08\x96\x01", 3);
    sdm_proto_text(&p, 2, "testing");
    expect_bytes(&p, "\x12\x07testing", 9);
    sdm_proto_int(&inner, 1, 150);
    sdm_proto_message(&p, 3, &inner);
    expect_bytes(&p, "\x1a\x03\x08\x96\x01", 5);
    sdm_proto_dispose(&inner);
    sdm_proto_int(&p, 1, (uint64_t)-2);
    expect_bytes(&p, "\x08\xfe\xff\xff\xff\xff\xff\xff\xff\xff\x01", 11);
    sdm_proto_float(&p, 2, 1);
    expect_bytes(&p, "\x15\0\0\x80\x3f", 5);
    sdm_proto_head(&p, 14, 300);
    expect_bytes(&p, "\x72\xac\x02", 3);
}

static void fill_nothing(const void *user, size_t item, float *to)
{
    (void)user, (void)item, (void)to;
    fail_msg("the weights of a file that is refused are computed");
}

static void test_limit(void **state)
{
    (void)state;
    const size_t dims[] = {1 << 15, 1 << 14}, map[] = {1, 1, 1};
    sdm_onnx *g;
    sdm_onnx_value x;
    sdm_error err = {0};
    assert_int_equal(sdm_onnx_create(1, &g, &x, &err), SDM_OK);
    const sdm_onnx_value w = sdm_onnx_weights(g, "large", 2, dims, fill_nothing, NULL);
    assert_int_equal(
        sdm_onnx_write(g, "test_onnx.onnx", sdm_onnx_node2(g, "MatMul", x, w), map, &err),
        SDM_E_UNSUPPORTED);
    assert_non_null(strstr(err.text, "2 GB"));
    assert_int_not_equal(access("test_onnx.onnx", F_OK), 0);
    sdm_onnx_free(g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_fields), cmocka_unit_test(test_limit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
