// The OpenGL 4.5 core functions that voxeld calls, as one struct of pointers per context. EGL and
// OSMesa have separate entry points, so a process that opens both needs two tables. A loader with
// global pointers (libepoxy) cannot serve OSMesa at all.
#pragma once

#include <GL/glcorearb.h>

#include <functional>

#include "proto/result.h"

// X(type, name without gl), sorted. A line added here is loaded and checked everywhere.
#define VOXELD_GL_FUNCTIONS(X)                                                                   \
  X(PFNGLACTIVETEXTUREPROC, ActiveTexture)                                                       \
  X(PFNGLATTACHSHADERPROC, AttachShader)                                                         \
  X(PFNGLBEGINQUERYPROC, BeginQuery)                                                             \
  X(PFNGLBINDBUFFERPROC, BindBuffer)                                                             \
  X(PFNGLBINDBUFFERBASEPROC, BindBufferBase)                                                     \
  X(PFNGLBINDBUFFERRANGEPROC, BindBufferRange)                                                   \
  X(PFNGLBINDBUFFERSBASEPROC, BindBuffersBase)                                                   \
  X(PFNGLBINDBUFFERSRANGEPROC, BindBuffersRange)                                                 \
  X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                                                   \
  X(PFNGLBINDIMAGETEXTUREPROC, BindImageTexture)                                                 \
  X(PFNGLBINDIMAGETEXTURESPROC, BindImageTextures)                                               \
  X(PFNGLBINDSAMPLERPROC, BindSampler)                                                           \
  X(PFNGLBINDTEXTUREPROC, BindTexture)                                                           \
  X(PFNGLBINDTEXTUREUNITPROC, BindTextureUnit)                                                   \
  X(PFNGLBINDTEXTURESPROC, BindTextures)                                                         \
  X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                                                   \
  X(PFNGLBLENDCOLORPROC, BlendColor)                                                             \
  X(PFNGLBLENDEQUATIONPROC, BlendEquation)                                                       \
  X(PFNGLBLENDEQUATIONSEPARATEPROC, BlendEquationSeparate)                                       \
  X(PFNGLBLENDFUNCPROC, BlendFunc)                                                               \
  X(PFNGLBLENDFUNCSEPARATEPROC, BlendFuncSeparate)                                               \
  X(PFNGLBLITFRAMEBUFFERPROC, BlitFramebuffer)                                                   \
  X(PFNGLBLITNAMEDFRAMEBUFFERPROC, BlitNamedFramebuffer)                                         \
  X(PFNGLCHECKNAMEDFRAMEBUFFERSTATUSPROC, CheckNamedFramebufferStatus)                           \
  X(PFNGLCLEARPROC, Clear)                                                                       \
  X(PFNGLCLEARBUFFERIVPROC, ClearBufferiv)                                                       \
  X(PFNGLCLEARBUFFERUIVPROC, ClearBufferuiv)                                                     \
  X(PFNGLCLEARCOLORPROC, ClearColor)                                                             \
  X(PFNGLCLEARDEPTHPROC, ClearDepth)                                                             \
  X(PFNGLCLEARNAMEDBUFFERDATAPROC, ClearNamedBufferData)                                         \
  X(PFNGLCLEARNAMEDBUFFERSUBDATAPROC, ClearNamedBufferSubData)                                   \
  X(PFNGLCLEARNAMEDFRAMEBUFFERFVPROC, ClearNamedFramebufferfv)                                   \
  X(PFNGLCLEARNAMEDFRAMEBUFFERIVPROC, ClearNamedFramebufferiv)                                   \
  X(PFNGLCLEARNAMEDFRAMEBUFFERUIVPROC, ClearNamedFramebufferuiv)                                 \
  X(PFNGLCLEARSTENCILPROC, ClearStencil)                                                         \
  X(PFNGLCLEARTEXIMAGEPROC, ClearTexImage)                                                       \
  X(PFNGLCLEARTEXSUBIMAGEPROC, ClearTexSubImage)                                                 \
  X(PFNGLCLIENTWAITSYNCPROC, ClientWaitSync)                                                     \
  X(PFNGLCLIPCONTROLPROC, ClipControl)                                                           \
  X(PFNGLCOLORMASKPROC, ColorMask)                                                               \
  X(PFNGLCOLORMASKIPROC, ColorMaski)                                                             \
  X(PFNGLCOMPILESHADERPROC, CompileShader)                                                       \
  X(PFNGLCOPYIMAGESUBDATAPROC, CopyImageSubData)                                                 \
  X(PFNGLCOPYNAMEDBUFFERSUBDATAPROC, CopyNamedBufferSubData)                                     \
  X(PFNGLCREATEBUFFERSPROC, CreateBuffers)                                                       \
  X(PFNGLCREATEFRAMEBUFFERSPROC, CreateFramebuffers)                                             \
  X(PFNGLCREATEPROGRAMPROC, CreateProgram)                                                       \
  X(PFNGLCREATEQUERIESPROC, CreateQueries)                                                       \
  X(PFNGLCREATESAMPLERSPROC, CreateSamplers)                                                     \
  X(PFNGLCREATESHADERPROC, CreateShader)                                                         \
  X(PFNGLCREATETEXTURESPROC, CreateTextures)                                                     \
  X(PFNGLCREATEVERTEXARRAYSPROC, CreateVertexArrays)                                             \
  X(PFNGLCULLFACEPROC, CullFace)                                                                 \
  X(PFNGLDEBUGMESSAGECALLBACKPROC, DebugMessageCallback)                                         \
  X(PFNGLDEBUGMESSAGECONTROLPROC, DebugMessageControl)                                           \
  X(PFNGLDEBUGMESSAGEINSERTPROC, DebugMessageInsert)                                             \
  X(PFNGLDELETEBUFFERSPROC, DeleteBuffers)                                                       \
  X(PFNGLDELETEFRAMEBUFFERSPROC, DeleteFramebuffers)                                             \
  X(PFNGLDELETEPROGRAMPROC, DeleteProgram)                                                       \
  X(PFNGLDELETEQUERIESPROC, DeleteQueries)                                                       \
  X(PFNGLDELETESAMPLERSPROC, DeleteSamplers)                                                     \
  X(PFNGLDELETESHADERPROC, DeleteShader)                                                         \
  X(PFNGLDELETESYNCPROC, DeleteSync)                                                             \
  X(PFNGLDELETETEXTURESPROC, DeleteTextures)                                                     \
  X(PFNGLDELETEVERTEXARRAYSPROC, DeleteVertexArrays)                                             \
  X(PFNGLDEPTHMASKPROC, DepthMask)                                                               \
  X(PFNGLDEPTHRANGEPROC, DepthRange)                                                             \
  X(PFNGLDETACHSHADERPROC, DetachShader)                                                         \
  X(PFNGLDISABLEPROC, Disable)                                                                   \
  X(PFNGLDISABLEIPROC, Disablei)                                                                 \
  X(PFNGLDISPATCHCOMPUTEPROC, DispatchCompute)                                                   \
  X(PFNGLDISPATCHCOMPUTEINDIRECTPROC, DispatchComputeIndirect)                                   \
  X(PFNGLDRAWARRAYSPROC, DrawArrays)                                                             \
  X(PFNGLDRAWARRAYSINDIRECTPROC, DrawArraysIndirect)                                             \
  X(PFNGLDRAWARRAYSINSTANCEDPROC, DrawArraysInstanced)                                           \
  X(PFNGLDRAWARRAYSINSTANCEDBASEINSTANCEPROC, DrawArraysInstancedBaseInstance)                   \
  X(PFNGLDRAWBUFFERSPROC, DrawBuffers)                                                           \
  X(PFNGLDRAWELEMENTSPROC, DrawElements)                                                         \
  X(PFNGLDRAWELEMENTSBASEVERTEXPROC, DrawElementsBaseVertex)                                     \
  X(PFNGLDRAWELEMENTSINDIRECTPROC, DrawElementsIndirect)                                         \
  X(PFNGLDRAWELEMENTSINSTANCEDPROC, DrawElementsInstanced)                                       \
  X(PFNGLDRAWELEMENTSINSTANCEDBASEINSTANCEPROC, DrawElementsInstancedBaseInstance)               \
  X(PFNGLENABLEPROC, Enable)                                                                     \
  X(PFNGLENABLEVERTEXARRAYATTRIBPROC, EnableVertexArrayAttrib)                                   \
  X(PFNGLENABLEIPROC, Enablei)                                                                   \
  X(PFNGLENDQUERYPROC, EndQuery)                                                                 \
  X(PFNGLFENCESYNCPROC, FenceSync)                                                               \
  X(PFNGLFINISHPROC, Finish)                                                                     \
  X(PFNGLFLUSHPROC, Flush)                                                                       \
  X(PFNGLFLUSHMAPPEDNAMEDBUFFERRANGEPROC, FlushMappedNamedBufferRange)                           \
  X(PFNGLFRONTFACEPROC, FrontFace)                                                               \
  X(PFNGLGETDEBUGMESSAGELOGPROC, GetDebugMessageLog)                                             \
  X(PFNGLGETERRORPROC, GetError)                                                                 \
  X(PFNGLGETFLOATVPROC, GetFloatv)                                                               \
  X(PFNGLGETGRAPHICSRESETSTATUSPROC, GetGraphicsResetStatus)                                     \
  X(PFNGLGETINTEGER64I_VPROC, GetInteger64i_v)                                                   \
  X(PFNGLGETINTEGER64VPROC, GetInteger64v)                                                       \
  X(PFNGLGETINTEGERI_VPROC, GetIntegeri_v)                                                       \
  X(PFNGLGETINTEGERVPROC, GetIntegerv)                                                           \
  X(PFNGLGETINTERNALFORMATI64VPROC, GetInternalformati64v)                                       \
  X(PFNGLGETINTERNALFORMATIVPROC, GetInternalformativ)                                           \
  X(PFNGLGETNAMEDBUFFERPARAMETERI64VPROC, GetNamedBufferParameteri64v)                           \
  X(PFNGLGETNAMEDBUFFERPARAMETERIVPROC, GetNamedBufferParameteriv)                               \
  X(PFNGLGETNAMEDBUFFERPOINTERVPROC, GetNamedBufferPointerv)                                     \
  X(PFNGLGETNAMEDBUFFERSUBDATAPROC, GetNamedBufferSubData)                                       \
  X(PFNGLGETNAMEDFRAMEBUFFERATTACHMENTPARAMETERIVPROC, GetNamedFramebufferAttachmentParameteriv) \
  X(PFNGLGETNAMEDFRAMEBUFFERPARAMETERIVPROC, GetNamedFramebufferParameteriv)                     \
  X(PFNGLGETOBJECTLABELPROC, GetObjectLabel)                                                     \
  X(PFNGLGETPROGRAMBINARYPROC, GetProgramBinary)                                                 \
  X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)                                               \
  X(PFNGLGETPROGRAMINTERFACEIVPROC, GetProgramInterfaceiv)                                       \
  X(PFNGLGETPROGRAMRESOURCEINDEXPROC, GetProgramResourceIndex)                                   \
  X(PFNGLGETPROGRAMRESOURCELOCATIONPROC, GetProgramResourceLocation)                             \
  X(PFNGLGETPROGRAMRESOURCELOCATIONINDEXPROC, GetProgramResourceLocationIndex)                   \
  X(PFNGLGETPROGRAMRESOURCENAMEPROC, GetProgramResourceName)                                     \
  X(PFNGLGETPROGRAMRESOURCEIVPROC, GetProgramResourceiv)                                         \
  X(PFNGLGETPROGRAMSTAGEIVPROC, GetProgramStageiv)                                               \
  X(PFNGLGETPROGRAMIVPROC, GetProgramiv)                                                         \
  X(PFNGLGETQUERYOBJECTI64VPROC, GetQueryObjecti64v)                                             \
  X(PFNGLGETQUERYOBJECTIVPROC, GetQueryObjectiv)                                                 \
  X(PFNGLGETQUERYOBJECTUI64VPROC, GetQueryObjectui64v)                                           \
  X(PFNGLGETQUERYIVPROC, GetQueryiv)                                                             \
  X(PFNGLGETSHADERINFOLOGPROC, GetShaderInfoLog)                                                 \
  X(PFNGLGETSHADERIVPROC, GetShaderiv)                                                           \
  X(PFNGLGETSTRINGPROC, GetString)                                                               \
  X(PFNGLGETSTRINGIPROC, GetStringi)                                                             \
  X(PFNGLGETSYNCIVPROC, GetSynciv)                                                               \
  X(PFNGLGETTEXTUREIMAGEPROC, GetTextureImage)                                                   \
  X(PFNGLGETTEXTURELEVELPARAMETERIVPROC, GetTextureLevelParameteriv)                             \
  X(PFNGLGETTEXTURESUBIMAGEPROC, GetTextureSubImage)                                             \
  X(PFNGLGETUNIFORMBLOCKINDEXPROC, GetUniformBlockIndex)                                         \
  X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)                                             \
  X(PFNGLINVALIDATEBUFFERDATAPROC, InvalidateBufferData)                                         \
  X(PFNGLINVALIDATENAMEDFRAMEBUFFERDATAPROC, InvalidateNamedFramebufferData)                     \
  X(PFNGLISENABLEDPROC, IsEnabled)                                                               \
  X(PFNGLLINKPROGRAMPROC, LinkProgram)                                                           \
  X(PFNGLLOGICOPPROC, LogicOp)                                                                   \
  X(PFNGLMAPNAMEDBUFFERRANGEPROC, MapNamedBufferRange)                                           \
  X(PFNGLMEMORYBARRIERPROC, MemoryBarrier)                                                       \
  X(PFNGLMEMORYBARRIERBYREGIONPROC, MemoryBarrierByRegion)                                       \
  X(PFNGLMINSAMPLESHADINGPROC, MinSampleShading)                                                 \
  X(PFNGLMULTIDRAWARRAYSINDIRECTPROC, MultiDrawArraysIndirect)                                   \
  X(PFNGLMULTIDRAWELEMENTSINDIRECTPROC, MultiDrawElementsIndirect)                               \
  X(PFNGLNAMEDBUFFERDATAPROC, NamedBufferData)                                                   \
  X(PFNGLNAMEDBUFFERSTORAGEPROC, NamedBufferStorage)                                             \
  X(PFNGLNAMEDBUFFERSUBDATAPROC, NamedBufferSubData)                                             \
  X(PFNGLNAMEDFRAMEBUFFERDRAWBUFFERPROC, NamedFramebufferDrawBuffer)                             \
  X(PFNGLNAMEDFRAMEBUFFERDRAWBUFFERSPROC, NamedFramebufferDrawBuffers)                           \
  X(PFNGLNAMEDFRAMEBUFFERPARAMETERIPROC, NamedFramebufferParameteri)                             \
  X(PFNGLNAMEDFRAMEBUFFERREADBUFFERPROC, NamedFramebufferReadBuffer)                             \
  X(PFNGLNAMEDFRAMEBUFFERTEXTUREPROC, NamedFramebufferTexture)                                   \
  X(PFNGLNAMEDFRAMEBUFFERTEXTURELAYERPROC, NamedFramebufferTextureLayer)                         \
  X(PFNGLOBJECTLABELPROC, ObjectLabel)                                                           \
  X(PFNGLPIXELSTOREIPROC, PixelStorei)                                                           \
  X(PFNGLPOLYGONOFFSETPROC, PolygonOffset)                                                       \
  X(PFNGLPOPDEBUGGROUPPROC, PopDebugGroup)                                                       \
  X(PFNGLPROGRAMBINARYPROC, ProgramBinary)                                                       \
  X(PFNGLPROGRAMPARAMETERIPROC, ProgramParameteri)                                               \
  X(PFNGLPUSHDEBUGGROUPPROC, PushDebugGroup)                                                     \
  X(PFNGLQUERYCOUNTERPROC, QueryCounter)                                                         \
  X(PFNGLREADPIXELSPROC, ReadPixels)                                                             \
  X(PFNGLREADNPIXELSPROC, ReadnPixels)                                                           \
  X(PFNGLSAMPLERPARAMETERIPROC, SamplerParameteri)                                               \
  X(PFNGLSCISSORPROC, Scissor)                                                                   \
  X(PFNGLSHADERSOURCEPROC, ShaderSource)                                                         \
  X(PFNGLSHADERSTORAGEBLOCKBINDINGPROC, ShaderStorageBlockBinding)                               \
  X(PFNGLTEXTUREBARRIERPROC, TextureBarrier)                                                     \
  X(PFNGLTEXTUREBUFFERPROC, TextureBuffer)                                                       \
  X(PFNGLTEXTUREBUFFERRANGEPROC, TextureBufferRange)                                             \
  X(PFNGLTEXTUREPARAMETERIPROC, TextureParameteri)                                               \
  X(PFNGLTEXTUREPARAMETERIVPROC, TextureParameteriv)                                             \
  X(PFNGLTEXTURESTORAGE1DPROC, TextureStorage1D)                                                 \
  X(PFNGLTEXTURESTORAGE2DPROC, TextureStorage2D)                                                 \
  X(PFNGLTEXTURESTORAGE3DPROC, TextureStorage3D)                                                 \
  X(PFNGLTEXTURESUBIMAGE1DPROC, TextureSubImage1D)                                               \
  X(PFNGLTEXTURESUBIMAGE2DPROC, TextureSubImage2D)                                               \
  X(PFNGLTEXTURESUBIMAGE3DPROC, TextureSubImage3D)                                               \
  X(PFNGLTEXTUREVIEWPROC, TextureView)                                                           \
  X(PFNGLUNIFORMBLOCKBINDINGPROC, UniformBlockBinding)                                           \
  X(PFNGLUNMAPNAMEDBUFFERPROC, UnmapNamedBuffer)                                                 \
  X(PFNGLUSEPROGRAMPROC, UseProgram)                                                             \
  X(PFNGLVALIDATEPROGRAMPROC, ValidateProgram)                                                   \
  X(PFNGLVERTEXARRAYATTRIBBINDINGPROC, VertexArrayAttribBinding)                                 \
  X(PFNGLVERTEXARRAYATTRIBFORMATPROC, VertexArrayAttribFormat)                                   \
  X(PFNGLVERTEXARRAYATTRIBIFORMATPROC, VertexArrayAttribIFormat)                                 \
  X(PFNGLVERTEXARRAYELEMENTBUFFERPROC, VertexArrayElementBuffer)                                 \
  X(PFNGLVERTEXARRAYVERTEXBUFFERPROC, VertexArrayVertexBuffer)                                   \
  X(PFNGLVIEWPORTPROC, Viewport)                                                                 \
  X(PFNGLVIEWPORTINDEXEDFPROC, ViewportIndexedf)                                                 \
  X(PFNGLWAITSYNCPROC, WaitSync)
// clang-format on

namespace voxeld::gpu {

// glFoo(…) is api.Foo(…). No default-block uniforms: parameters go through uniform buffers, see
// the driver workaround zink_stale_uniforms.
struct GlApi {
#define VOXELD_GL_MEMBER(type, name) type name = nullptr;
  VOXELD_GL_FUNCTIONS(VOXELD_GL_MEMBER)
#undef VOXELD_GL_MEMBER
};

using GlProc = void (*)();
using GetGlProc = std::function<GlProc(const char* name)>;

// Fills the table. Errors: device-unavailable, naming the first function that the driver lacks.
Result<GlApi> load_gl_api(const GetGlProc& get_proc);

// "GL_OUT_OF_MEMORY"; a hexadecimal number for a code that OpenGL 4.5 does not define.
std::string gl_error_name(GLenum error);

}  // namespace voxeld::gpu
