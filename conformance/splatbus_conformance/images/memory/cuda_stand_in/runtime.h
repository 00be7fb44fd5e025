/* The runtime's calls, for the driver's. */

#ifndef RUNTIME_H
#define RUNTIME_H
#include "objects.h"

int cudaGetDeviceCount(int *count);
int cudaGetDevice(int *which);
int cudaDriverGetVersion(int *version);
int cudaDeviceGetAttribute(int *value, int attribute, int which);
int cudaDeviceSynchronize(void);
int cudaMalloc(void **to, size_t size);
int cudaMallocHost(void **to, size_t size);
int cudaFree(void *pointer);
int cudaFreeHost(void *pointer);
int cudaMemset(void *to, int value, size_t size);
int cudaMemsetAsync(void *pointer, int value, size_t size, void *stream);
int cudaMemcpy(void *to, const void *from, size_t size, int kind);
int cudaMemcpyAsync(void *to, const void *from, size_t size, int kind, void *stream);
int cudaMemcpy2D(void *to, size_t to_pitch, const void *from, size_t pitch, size_t width,
                 size_t height, int kind);
int cudaMemcpy2DAsync(void *to, size_t to_pitch, const void *from, size_t pitch, size_t width,
                      size_t height, int kind, void *stream);
int cudaStreamCreateWithFlags(void **stream, unsigned flags);
int cudaStreamSynchronize(void *stream);
int cudaStreamQuery(void *stream);
int cudaStreamDestroy(void *stream);
int cudaStreamWaitEvent(void *stream, void *event, unsigned flags);
int cudaEventCreateWithFlags(void **event, unsigned flags);
int cudaEventRecord(void *event, void *stream);
int cudaEventQuery(void *event);
int cudaEventSynchronize(void *event);
int cudaEventDestroy(void *event);
int cudaEventElapsedTime(float *milliseconds, void *from, void *to);
int cudaIpcGetMemHandle(struct handle *handle, void *pointer);
int cudaIpcOpenMemHandle(void **pointer, struct handle handle, unsigned flags);
int cudaIpcCloseMemHandle(void *pointer);
int cudaIpcGetEventHandle(struct handle *handle, void *event);
int cudaIpcOpenEventHandle(void **event, struct handle handle);
#endif
