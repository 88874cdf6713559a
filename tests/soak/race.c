/* Two threads change a number without a lock: what ThreadSanitizer must report. If it does not, the
 * tests under it show nothing. */
#include <pthread.h>
#include <stdio.h>

static int number;

static void *count(void *unused)
{
    for (int i = 0; i < 100000; i++) number++;
    return unused;
}

int main(void)
{
    pthread_t other;
    if (pthread_create(&other, NULL, count, NULL)) return 1;
    count(NULL);
    pthread_join(other, NULL);
    printf("%d\n", number);
    return 0;
}
