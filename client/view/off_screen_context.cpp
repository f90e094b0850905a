#include <epoxy/egl.h>

#include "client/view/gl_context.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

class OffScreenContext final : public GlContext {
 public:
  OffScreenContext(EGLDisplay display, EGLContext context) : display_(display), context_(context) {}
  ~OffScreenContext() override {
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
    // the display stays: it is the process's, and a driver that was unloaded could not be named by who looks
    // for leaks
  }
  OffScreenContext(const OffScreenContext&) = delete;
  OffScreenContext& operator=(const OffScreenContext&) = delete;
  [[nodiscard]] GLFWwindow* window() const override { return nullptr; }
  void swap() override {}

 private:
  EGLDisplay display_;
  EGLContext context_;
};

Error refusal(const char* what) {
  return Error{
      ErrorCode::kUnavailable,
      formatted("no picture can be drawn without a display (%s, EGL error 0x%x): install libegl1 and "
                "libgl1-mesa-dri",
                what, static_cast<unsigned>(eglGetError()))};
}

}  // namespace

Result<std::unique_ptr<GlContext>> makeOffScreenContext() {
  const EGLDisplay display =
      eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display == EGL_NO_DISPLAY) return refusal("no surfaceless platform");
  EGLint major = 0, minor = 0;
  if (eglInitialize(display, &major, &minor) != EGL_TRUE) return refusal("eglInitialize");
  if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) {
    eglTerminate(display);
    return refusal("no OpenGL");
  }
  constexpr EGLint kAttributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                    3,
                                    EGL_CONTEXT_MINOR_VERSION,
                                    3,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                    EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                    EGL_NONE};
  const EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kAttributes);
  auto made = std::make_unique<OffScreenContext>(display, context);
  if (context == EGL_NO_CONTEXT) return refusal("no OpenGL 3.3 core context");
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) != EGL_TRUE)
    return refusal("eglMakeCurrent");
  return std::unique_ptr<GlContext>(std::move(made));
}

}  // namespace needlelab
