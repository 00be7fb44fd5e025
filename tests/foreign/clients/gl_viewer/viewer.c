/* An OpenGL viewer without OpenGL: what it would upload, it only copies. */
#include <arpa/inet.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

typedef struct { char bytes[64]; } Handle;
typedef void *Event, *Stream;
int cudaIpcOpenMemHandle(void **, Handle, unsigned);
int cudaIpcOpenEventHandle(Event *, Handle);
int cudaStreamWaitEvent(Stream, Event, unsigned);
int cudaStreamSynchronize(Stream);
int cudaMemcpyAsync(void *, const void *, size_t, int, Stream);

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct {
    int w, h;
    long colour_at, depth_at;
    char *colour, *depth;
    Event done;
    float *pixels, *distances;
} shown;

static int call(const char *variable) {
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(getenv(variable)))};
    inet_pton(AF_INET, getenv("SPLATBUS_HOST"), &to.sin_addr);
    for (;;) {
        int s = socket(AF_INET, SOCK_STREAM, 0);
        if (!connect(s, (struct sockaddr *)&to, sizeof to)) return s;
        close(s);
        usleep(400000);
    }
}

static int all(int s, char *to, size_t count) {
    while (count) {
        ssize_t got = recv(s, to, count, 0);
        if (got <= 0) return 0;
        to += got;
        count -= (size_t)got;
    }
    return 1;
}

/* The next message, to be freed; NULL when the connection is over. */
static char *message(int s) {
    uint32_t length;
    if (!all(s, (char *)&length, 4)) return NULL;
    char *text = malloc((size_t)length + 1);
    if (!text || !all(s, text, length)) {
        free(text);
        return NULL;
    }
    text[length] = 0;
    return text;
}

static void say(int s, const char *text) {
    uint32_t length = (uint32_t)strlen(text);
    send(s, &length, 4, MSG_NOSIGNAL);
    send(s, text, length, MSG_NOSIGNAL);
}

static const char *after(const char *text, const char *name) {
    char quoted[40];
    snprintf(quoted, sizeof quoted, "\"%s\":", name);
    const char *found = strstr(text, quoted);
    if (!found) return NULL;
    found += strlen(quoted);
    while (*found == ' ') found++;
    return found;
}

static long integer(const char *text, const char *name, long otherwise) {
    const char *found = after(text, name);
    return found ? strtol(found, NULL, 10) : otherwise;
}

static int handle(const char *text, const char *name, Handle *to) {
    const char *letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/", *at;
    const char *found = after(text, name);
    if (!found || *found++ != '"') return 0;
    uint32_t bits = 0;
    int got = 0, out = 0;
    for (; *found && (at = strchr(letters, *found)) && out < 64; found++) {
        bits = bits << 6 | (uint32_t)(at - letters);
        if ((got += 6) >= 8) to->bytes[out++] = (char)(bits >> (got -= 8));
    }
    return out == 64;
}

/* Every 30 ms, for as long as there is a window. */
static void *draw(void *unused) {
    for (;; usleep(30000)) {
        pthread_mutex_lock(&lock);
        if (shown.colour) {
            size_t pixels = (size_t)shown.w * (size_t)shown.h;
            cudaStreamWaitEvent(NULL, shown.done, 0);
            cudaMemcpyAsync(shown.pixels, shown.colour + shown.colour_at, 16 * pixels, 2, NULL);
            cudaMemcpyAsync(shown.distances, shown.depth + shown.depth_at, 4 * pixels, 2, NULL);
            cudaStreamSynchronize(NULL);
        }
        pthread_mutex_unlock(&lock);
    }
    return unused;
}

static void show(const char *text) {
    Handle colour, depth, done;
    if (!handle(text, "mem_color", &colour) || !handle(text, "mem_depth", &depth) || !handle(text, "evt_done", &done)) return;
    long w = integer(text, "w", 0), h = integer(text, "h", 0);
    if (w < 1 || h < 1 || w > 32768 || h > 32768) return;
    pthread_mutex_lock(&lock);
    free(shown.pixels);
    free(shown.distances);
    memset(&shown, 0, sizeof shown);
    shown.w = (int)w;
    shown.h = (int)h;
    shown.pixels = malloc(16 * (size_t)w * (size_t)h);
    shown.distances = malloc(4 * (size_t)w * (size_t)h);
    shown.colour_at = integer(text, "offsetColor", 0);
    shown.depth_at = integer(text, "offsetDepth", 0);
    void *memory = NULL, *other = NULL;
    int good = shown.pixels && shown.distances && !cudaIpcOpenMemHandle(&memory, colour, 1);
    if (!memcmp(&colour, &depth, sizeof colour)) other = memory;
    else good = good && !cudaIpcOpenMemHandle(&other, depth, 1);
    good = good && !cudaIpcOpenEventHandle(&shown.done, done);
    shown.colour = good ? memory : NULL;
    shown.depth = other;
    pthread_mutex_unlock(&lock);
}

static void *images(void *unused) {
    for (;; usleep(300000)) {
        int s = call("SPLATBUS_IPC_PORT");
        for (char *text; (text = message(s)); free(text)) show(text);
        close(s);
    }
    return unused;
}

static int moved(int s, const double *c, double turn) {
    char text[600];
    snprintf(text, sizeof text,
             "{\"type\": \"camera_pose\", \"position\": {\"x\": \"%.17g\", \"y\": \"%.17g\", \"z\": \"%.17g\"}, "
             "\"rotation\": {\"x\": \"0\", \"y\": \"%.17g\", \"z\": \"0\", \"w\": \"%.17g\"}}",
             c[0], c[1], c[2] + sin(turn), sin(turn / 2), cos(turn / 2));
    say(s, text);
    usleep(20000);
    char byte;
    ssize_t got = recv(s, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
    if (got > 0) free(message(s));
    return got != 0;
}

int main(void) {
    pthread_t drawing, reading;
    pthread_create(&drawing, NULL, draw, NULL);
    pthread_create(&reading, NULL, images, NULL);
    for (;; usleep(300000)) {
        int s = call("SPLATBUS_MSG_PORT");
        double c[3] = {0, 0, 0};
        say(s, "{\"type\": \"get_camera_pose\", \"cam_idx\": 0}");
        char *text = message(s);
        const char *position = text ? after(text, "position") : NULL;
        if (position && *position == '[') {
            char *at = (char *)position + 1;
            for (int i = 0; i < 3; i++) {
                c[i] = strtod(at, &at);
                if (*at == ',') at++;
                if (!isfinite(c[i])) c[i] = 0;
            }
            for (double turn = 0; moved(s, c, turn); turn += 0.01);
        }
        free(text);
        close(s);
    }
}
