/* What runtime and driver hand out, the files behind it, and the trace. */

#include "objects.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/mman.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <time.h>

#define SAFELY (O_CLOEXEC | O_NOFOLLOW)
#define UNLINK (-1)
#define POISON 0xFF /* four of them are a NaN */

_Thread_local int last_error, device;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct object *all;
static int trace = -1, is_used;

double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + (double)time.tv_nsec * 1e-9;
}

void enter(void) { pthread_mutex_lock(&lock); }

void let_others_in(void) {
    const struct timespec moment = {0, 200000};
    pthread_mutex_unlock(&lock);
    nanosleep(&moment, NULL);
    pthread_mutex_lock(&lock);
}

int leave(const char *call, int code, const char *format, ...) {
    char members[512];
    va_list values;
    va_start(values, format);
    vsnprintf(members, sizeof members, format, values);
    va_end(values);
    /* One write a line, so that those of several processes do not mix. */
    if (trace >= 0)
        dprintf(trace, "{\"t\":%.6f,\"pid\":%d,\"call\":\"cuda%s\",\"code\":%d,\"on\":%d,%s}\n",
                now(), getpid(), call, code, device, members);
    if (code && code != NOT_READY) /* which the real one does not keep either */
        last_error = code;
    pthread_mutex_unlock(&lock);
    return code;
}

void load(void) {
    enter();
    if (is_used++)
        pthread_mutex_unlock(&lock);
    else
        leave("Load", SUCCESS, "\"left\":0");
}

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("SPLATBUS_STAND_IN_TRACE");
    if (path)
        trace = open(path, O_WRONLY | O_CREAT | O_APPEND | SAFELY, 0600);
    if (!&is_the_driver) /* for which programs look that then use a runtime of their own */
        load();
}

__attribute__((destructor)) static void end(void) {
    enter();
    while (all)
        drop(all);
    if (is_used)
        leave("Exit", SUCCESS, "\"left\":0");
}

/* Files */

static int open_file(enum kind kind, const char *name, int flags) {
    char usual[64], path[32];
    struct stat status;
    const char *folder_path = getenv("SPLATBUS_STAND_IN_DEVICE");
    int folder, file = -1;
    if (!folder_path) {
        snprintf(usual, sizeof usual, "/dev/shm/splatbus-stand-in-%u", (unsigned)getuid());
        mkdir(folder_path = usual, 0700);
    }
    snprintf(path, sizeof path, "%s-%s", kind == EVENT ? "event" : "memory", name);
    folder = open(folder_path, O_RDONLY | O_DIRECTORY | SAFELY);
    if (folder >= 0 && !fstat(folder, &status) && status.st_uid == getuid())
        file = flags == UNLINK ? unlinkat(folder, path, 0)
                               : openat(folder, path, O_RDWR | SAFELY | flags, 0600);
    if (folder >= 0)
        close(folder);
    return file;
}

static char *map_file(enum kind kind, const char *name, size_t *size, int flags) {
    const size_t least = kind == EVENT ? sizeof(struct progress) : 1;
    struct stat status;
    void *bytes = MAP_FAILED;
    int file = open_file(kind, name, flags);
    if (file < 0)
        return NULL;
    /* Room is taken at once: to run out of it later would be a SIGBUS. */
    if (!flags || !posix_fallocate(file, 0, (off_t)*size))
        if (!fstat(file, &status) && (*size = (size_t)status.st_size) >= least)
            bytes = mmap(NULL, *size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (bytes == MAP_FAILED && flags)
        open_file(kind, name, UNLINK);
    return bytes == MAP_FAILED ? NULL : bytes;
}

/* Objects */

struct object *first(void) { return all; }

struct object *containing(const void *pointer) {
    for (struct object *each = all; each; each = each->next)
        if (each->kind & MEMORY && (uintptr_t)pointer - (uintptr_t)each->address < each->size)
            return each;
    return NULL;
}

struct object *known(const void *object, unsigned kinds) {
    struct object *each = all;
    while (each && each != object)
        each = each->next;
    return each && each->kind & kinds ? each : NULL;
}

static struct object *add(struct object object) {
    struct object *kept = malloc(sizeof *kept);
    object.address = object.bytes;
    if (object.kind & DEVICE_MEMORY)
        object.address = mmap(NULL, object.size, PROT_NONE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (!kept || object.address == MAP_FAILED)
        abort(); /* without room for this nobody would be judged fairly */
    *kept = object;
    kept->next = all;
    return all = kept;
}

struct object *create(enum kind kind, size_t size) {
    struct object object = {.kind = kind, .exporter = getpid(), .size = size, .opened = 1};
    uint64_t random;
    if (size > MOST_BYTES || getrandom(&random, sizeof random, 0) != sizeof random)
        return NULL;
    snprintf(object.name, sizeof object.name, "%016llx", (unsigned long long)random);
    if (kind == PINNED)
        object.bytes = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    else if (kind != STREAM)
        object.bytes = map_file(kind, object.name, &object.size, O_CREAT | O_EXCL);
    if (object.bytes == MAP_FAILED || (!object.bytes && kind != STREAM))
        return NULL;
    if (kind == ALLOCATED)
        memset(object.bytes, POISON, size);
    return add(object);
}

void drop(struct object *object) {
    struct object **link = &all;
    while (*link != object)
        link = &(*link)->next;
    *link = object->next;
    if (object->kind == ALLOCATED)
        memset(object->bytes, POISON, object->size);
    if (object->kind & (ALLOCATED | EVENT) && object->exporter == getpid())
        open_file(object->kind, object->name, UNLINK);
    if (object->address != object->bytes)
        munmap(object->address, object->size);
    if (object->bytes)
        munmap(object->bytes, object->size);
    free(object);
}

/* Handles */

void write_handle(struct handle *handle, const struct object *object) {
    char text[sizeof handle->bytes + 1] = "";
    snprintf(text, sizeof text, "splatbus-stand-in %s %010d %s",
             object->kind == EVENT ? "event" : "memory", object->exporter, object->name);
    memcpy(handle->bytes, text, sizeof handle->bytes);
}

static int read_handle(const struct handle *handle, struct object *to) {
    char text[sizeof handle->bytes + 1] = "";
    struct handle again;
    memcpy(text, handle->bytes, sizeof handle->bytes);
    if (sscanf(text, "splatbus-stand-in %*s %10d %16[0-9a-f]", &to->exporter, to->name) != 2)
        return 0;
    write_handle(&again, to); /* a handle is one to its last bit, or none */
    return memcmp(&again, handle, sizeof again) == 0;
}

int import(const struct handle *handle, enum kind kind, struct object **object) {
    struct object found = {.kind = kind, .opened = 1}, *each = all;
    const int unknown = kind == EVENT ? NO_EVENT : INVALID_VALUE;
    if (!read_handle(handle, &found))
        return unknown;
    if (found.exporter == getpid())
        return OWN_HANDLE;
    while (each && !(kind == each->kind && kind == IMPORTED && !strcmp(each->name, found.name)))
        each = each->next;
    if (each)
        each->opened++;
    else if ((found.bytes = map_file(kind, found.name, &found.size, 0)))
        each = add(found);
    if ((*object = each))
        return SUCCESS;
    return kind == IMPORTED && kill(found.exporter, 0) && errno == ESRCH ? INVALID_RESOURCE
                                                                        : unknown;
}
