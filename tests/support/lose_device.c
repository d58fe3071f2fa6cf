// A Vulkan layer for tests: the process's queue submit of the number LOSE_DEVICE_AT is told, once, that the device is
// lost. Written without Vulkan's headers, which machines that only run programs lack.
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef void (*Function)(void);
typedef Function (*GetFunction)(void *, const char *);

// VkLayerInstanceLink and VkLayerDeviceLink, and the create infos that lead to them, as far as both are alike.
typedef struct Link {
    struct Link *next;
    GetFunction instance_function, device_function;
} Link;
typedef struct Info {
    int32_t type;
    const struct Info *next;
    int32_t function;
    Link *link;
} Info;
typedef struct Interface {
    int32_t type;
    void *next;
    uint32_t version;
    GetFunction instance_function, device_function, physical_device_function;
} Interface;

enum { INSTANCE_INFO = 47, DEVICE_INFO = 48, LINK = 0, DEVICE_LOST = -4 };

static void *instance;
static GetFunction next_instance_function, next_device_function;
static int32_t (*next_submit)(void *, uint32_t, const void *, uint64_t);
static long n_submits;

static Link *link_of(const Info *info, int32_t type) {
    for (info = info->next; info->type != type || info->function != LINK;) info = info->next;
    Link *link = info->link;
    ((Info *)info)->link = link->next;
    return link;
}

static int32_t submit(void *queue, uint32_t n, const void *infos, uint64_t fence) {
    const char *at = getenv("LOSE_DEVICE_AT");
    if (at && ++n_submits == atol(at)) {
        unsetenv("LOSE_DEVICE_AT");
        return DEVICE_LOST;
    }
    return next_submit(queue, n, infos, fence);
}

static int32_t create_instance(const Info *info, const void *allocator, void **created) {
    next_instance_function = link_of(info, INSTANCE_INFO)->instance_function;
    int32_t (*create)(const Info *, const void *, void **) = (void *)next_instance_function(NULL, "vkCreateInstance");
    int32_t result = create(info, allocator, created);
    instance = *created;
    return result;
}

static int32_t create_device(void *device, const Info *info, const void *allocator, void **created) {
    Link *link = link_of(info, DEVICE_INFO);
    next_device_function = link->device_function;
    int32_t (*create)(void *, const Info *, const void *, void **) =
        (void *)link->instance_function(instance, "vkCreateDevice");
    int32_t result = create(device, info, allocator, created);
    if (result == 0) next_submit = (void *)next_device_function(*created, "vkQueueSubmit2");
    return result;
}

static Function device_function(void *device, const char *name) {
    if (strcmp(name, "vkGetDeviceProcAddr") == 0) return (Function)device_function;
    if (strcmp(name, "vkQueueSubmit2") == 0) return (Function)submit;
    return next_device_function(device, name);
}

static Function instance_function(void *of, const char *name) {
    if (strcmp(name, "vkGetInstanceProcAddr") == 0) return (Function)instance_function;
    if (strcmp(name, "vkCreateInstance") == 0) return (Function)create_instance;
    if (strcmp(name, "vkCreateDevice") == 0) return (Function)create_device;
    if (strcmp(name, "vkGetDeviceProcAddr") == 0) return (Function)device_function;
    if (strcmp(name, "vkQueueSubmit2") == 0) return (Function)submit;
    return next_instance_function(of, name);
}

int32_t vkNegotiateLoaderLayerInterfaceVersion(Interface *interface) {
    interface->version = 2;
    interface->instance_function = instance_function;
    interface->device_function = device_function;
    interface->physical_device_function = NULL;
    return 0;
}
