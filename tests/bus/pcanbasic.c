/* PCAN-Basic as far as python-can asks it, for tests: one channel, whose other end is the packet socket that
 * TESTS_PCAN_WIRE names. Strict: only the channel that was initialised, standard bit rates, frames of 8 bytes at most. */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { OK = 0, TRANSMIT_QUEUE_FULL = 0x80, RECEIVE_QUEUE_EMPTY = 0x20, NO_DRIVER = 0x200, ILLEGAL_HARDWARE = 0x1400,
       ILLEGAL_PARAMETER = 0x4000, NOT_INITIALISED = 0x4000000 };
enum { CHANNEL = 0x51, RECEIVE_EVENT = 0x03, API_VERSION = 0x05, ATTACHED_COUNT = 0x2A, ATTACHED = 0x2B };

struct message { uint32_t id; uint8_t type, length, data[8]; };
struct timestamp { uint32_t millis; uint16_t overflow, micros; };
struct information { uint16_t handle; uint8_t device, controller; uint32_t features; char name[33]; uint32_t id, condition; };

static int wire = -1;

static const char *named(void) { return getenv("TESTS_PCAN_WIRE"); }

uint32_t CAN_Initialize(uint16_t channel, uint16_t bit_rate, uint8_t kind, uint32_t port, uint16_t interrupt) {
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    uint8_t said[3] = { 'B', bit_rate >> 8, bit_rate & 0xFF };
    (void)kind, (void)port, (void)interrupt;
    if (channel != CHANNEL || named() == NULL) return ILLEGAL_HARDWARE;
    if (wire >= 0) return ILLEGAL_PARAMETER;
    snprintf(address.sun_path, sizeof address.sun_path, "%s", named());
    wire = socket(AF_UNIX, SOCK_SEQPACKET, 0);
    if (connect(wire, (struct sockaddr *)&address, sizeof address) != 0 || send(wire, said, 3, MSG_NOSIGNAL) != 3) {
        close(wire);
        wire = -1;
        return NO_DRIVER;
    }
    return OK;
}

uint32_t CAN_Uninitialize(uint16_t channel) {
    if (channel != CHANNEL || wire < 0) return NOT_INITIALISED;
    close(wire);
    wire = -1;
    return OK;
}

uint32_t CAN_Reset(uint16_t channel) { return channel == CHANNEL && wire >= 0 ? OK : NOT_INITIALISED; }
uint32_t CAN_GetStatus(uint16_t channel) { return CAN_Reset(channel); }

uint32_t CAN_Read(uint16_t channel, struct message *message, struct timestamp *at) {
    struct timespec now;
    ssize_t got;
    if (channel != CHANNEL || wire < 0) return NOT_INITIALISED;
    got = recv(wire, message, sizeof *message, MSG_DONTWAIT);
    if (got < 0) return errno == EAGAIN ? RECEIVE_QUEUE_EMPTY : ILLEGAL_HARDWARE;
    if (got == 0) return ILLEGAL_HARDWARE;  /* unplugged */
    clock_gettime(CLOCK_BOOTTIME, &now);
    at->millis = now.tv_sec * 1000 + now.tv_nsec / 1000000;
    at->overflow = 0;
    at->micros = now.tv_nsec / 1000 % 1000;
    return OK;
}

uint32_t CAN_Write(uint16_t channel, struct message *message) {
    if (channel != CHANNEL || wire < 0) return NOT_INITIALISED;
    if (message->length > 8 || message->id > ((message->type & 2) ? 0x1FFFFFFF : 0x7FF)) return ILLEGAL_PARAMETER;
    if (send(wire, message, sizeof *message, MSG_DONTWAIT | MSG_NOSIGNAL) < 0)
        return errno == EAGAIN ? TRANSMIT_QUEUE_FULL : ILLEGAL_HARDWARE;
    return OK;
}

uint32_t CAN_GetValue(uint16_t channel, uint8_t parameter, void *buffer, uint32_t size) {
    if (parameter == API_VERSION) return snprintf(buffer, size, "4, 8, 0, 5") > 0 ? OK : ILLEGAL_PARAMETER;
    if (parameter == ATTACHED_COUNT) return *(uint32_t *)buffer = named() != NULL, OK;
    if (parameter == ATTACHED && size >= sizeof(struct information)) {
        struct information *one = buffer;
        memset(one, 0, sizeof *one);
        one->handle = CHANNEL;
        one->device = 5;
        one->condition = 1;
        strcpy(one->name, "PCAN-USB");
        return OK;
    }
    if (channel != CHANNEL || wire < 0) return NOT_INITIALISED;
    if (parameter == RECEIVE_EVENT) return *(int *)buffer = wire, OK;
    return ILLEGAL_PARAMETER;
}

uint32_t CAN_SetValue(uint16_t channel, uint8_t parameter, void *buffer, uint32_t size) {
    (void)parameter, (void)buffer, (void)size;
    return channel == CHANNEL ? OK : ILLEGAL_PARAMETER;
}

uint32_t CAN_GetErrorText(uint32_t error, uint16_t language, char *buffer) {
    (void)language;
    switch (error) {
    case TRANSMIT_QUEUE_FULL: strcpy(buffer, "The transmit queue is full"); return OK;
    case NO_DRIVER: strcpy(buffer, "The driver is not loaded"); return OK;
    case ILLEGAL_HARDWARE: strcpy(buffer, "The hardware handle is invalid"); return OK;
    case NOT_INITIALISED: strcpy(buffer, "The channel is not initialized"); return OK;
    case ILLEGAL_PARAMETER: strcpy(buffer, "A parameter is invalid"); return OK;
    }
    return ILLEGAL_PARAMETER;
}
