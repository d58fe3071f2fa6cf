# Makes a library of the GLSL compiler shaderc that cargo can link, out of the system's packages. setup reads this file,
# and gives it: root, shaderc_folder, manager, has() and compiler().
# shellcheck shell=sh disable=SC2154

# Libraries that are complete by themselves, under the names that the crate looks for; the best comes first.
complete_libraries='libshaderc_shared.so libshaderc.so libshaderc_shared.dylib libshaderc.dylib libshaderc_combined.a'
# Debian's and Ubuntu's libshaderc is not complete: these archives of three packages are, together. Later versions of
# glslang come without some of them.
archives='shaderc_combined glslang MachineIndependent OSDependent GenericCodeGen OGLCompiler HLSL SPIRV SPVRemapper
    glslang-default-resource-limits SPIRV-Tools-opt SPIRV-Tools'

# The path of a library of the system; nothing if there is none. A compiler answers with a bare name then.
find_library() {
    path=$("$(compiler)" -print-file-name="$1" 2>/dev/null) || path=
    for path in "$path" "$root/opt/homebrew/lib/$1" "$root/usr/local/lib/$1"; do
        case $path in
            /*) if [ -e "$path" ]; then echo "$path" && return; fi ;;
        esac
    done
}

# All files that the library could be made of, a path a line.
library_files() {
    for name in $complete_libraries; do
        find_library $name
    done
    for name in $archives; do
        [ $name = shaderc_combined ] || find_library lib$name.a
    done
}

# Those files with their checksums: the library is as old as they are if they are the same.
# shellcheck disable=SC2046
library_state() {
    set -- $(library_files)
    [ $# -eq 0 ] || cksum "$@"
}

# Whether the system has packages to make the library of.
has_shaderc() {
    case $manager in
        apt-get) needed='libshaderc_combined.a libglslang.a libSPIRV-Tools-opt.a' ;;
        *) needed= ;;
    esac
    for name in $needed; do
        [ -n "$(find_library $name)" ] || return 1
    done
    for name in $complete_libraries; do
        [ -z "$(find_library $name)" ] || return 0
    done
    return 1
}

# Joins all archives into one in the folder.
join_archives() {
    has ar && [ -n "$(find_library libshaderc_combined.a)" ] && [ -n "$(find_library libglslang.a)" ] || return 1
    {
        echo create libshaderc_combined.a
        for name in $archives; do
            path=$(find_library lib$name.a)
            [ -z "$path" ] || echo "addlib $path"
        done
        echo save
        echo end
    } | (cd "$shaderc_folder" && ar -M)
}

# Puts the library into the folder: a joined one, or a link to the complete one of the given name.
put_library() {
    if [ "$1" = joined ]; then
        join_archives
    else
        path=$(find_library "$1")
        [ -n "$path" ] && ln -s "$path" "$shaderc_folder/$1"
    fi
}

# Whether a program that links the folder's library runs, and compiles a shader with what kdray's shaders use.
links() {
    for library in "$shaderc_folder"/libshaderc*; do
        name=${library##*/lib}
        name=${name%.*}
    done
    cat >"$shaderc_folder/check.cpp" <<'END'
extern "C" {
void *shaderc_compiler_initialize();
void *shaderc_compile_options_initialize();
void shaderc_compile_options_set_target_env(void *options, int environment, unsigned version);
void shaderc_compile_options_set_optimization_level(void *options, int level);
void *shaderc_compile_into_spv(void *compiler, const char *source, decltype(sizeof 0) length, int kind,
                               const char *file, const char *entry, void *options);
int shaderc_result_get_compilation_status(void *result);
}

const char shader[] = "#version 460\n"
                      "#extension GL_KHR_shader_subgroup_arithmetic : require\n"
                      "#extension GL_EXT_shader_atomic_int64 : require\n"
                      "#extension GL_EXT_buffer_reference_uvec2 : require\n"
                      "#extension GL_EXT_ray_tracing : require\n"
                      "void main() { subgroupAdd(1); }\n";

int main() {
    void *options = shaderc_compile_options_initialize();
    shaderc_compile_options_set_target_env(options, 0, 1u << 22 | 3u << 12); // Vulkan 1.3
    shaderc_compile_options_set_optimization_level(options, 2);              // performance
    void *result = shaderc_compile_into_spv(shaderc_compiler_initialize(), shader, sizeof shader - 1, 2, "check.comp",
                                            "main", options);
    return shaderc_result_get_compilation_status(result);
}
END
    "$(compiler)" -o "$shaderc_folder/check" "$shaderc_folder/check.cpp" -L"$shaderc_folder" -l"$name" -pthread \
        2>/dev/null && "$shaderc_folder/check" >/dev/null 2>&1 || return 1
    rm "$shaderc_folder/check" "$shaderc_folder/check.cpp"
}

# Makes the folder with a library that links, or returns 1 and leaves no folder.
make_library() {
    for way in joined $complete_libraries; do
        rm -rf "$shaderc_folder"
        mkdir -p "$shaderc_folder"
        if put_library $way && links; then
            return
        fi
    done
    rm -rf "$shaderc_folder"
    return 1
}

# Whether the folder is what this state of the system gives.
is_prepared() {
    [ -e "$shaderc_folder/made-of" ] && [ "$(cat "$shaderc_folder/made-of")" = "$(library_state)" ]
}
