// SPDX-License-Identifier: MIT
//
// A stub of URP 12 (SPLATBUS_URP_HANDLES: 13 and later): see the head of UnityEngine.cs, which is true of this file, too.
namespace UnityEngine.Rendering
{
    public struct RenderTargetIdentifier { public static implicit operator RenderTargetIdentifier(int nameID) { return new RenderTargetIdentifier(); } }

    public class CommandBuffer
    {
        public void GetTemporaryRT(int nameID, RenderTextureDescriptor desc, FilterMode filter) { }
        public void ReleaseTemporaryRT(int nameID) { }
        public void Blit(RenderTargetIdentifier source, RenderTargetIdentifier dest) { }
        public void Blit(RenderTargetIdentifier source, RenderTargetIdentifier dest, Material mat, int pass) { }
    }

    public static class CommandBufferPool
    {
        public static CommandBuffer Get(string name) { return new CommandBuffer(); }
        public static void Release(CommandBuffer buffer) { }
    }

    public struct ScriptableRenderContext { public void ExecuteCommandBuffer(CommandBuffer commandBuffer) { } }
    public class RTHandle { public static implicit operator RenderTargetIdentifier(RTHandle handle) { return new RenderTargetIdentifier(); } }
}

namespace UnityEngine
{
    public struct RenderTextureDescriptor
    {
        public int depthBufferBits { get; set; }
        public int msaaSamples { get; set; }
    }
}

namespace UnityEngine.Rendering.Universal
{
    public enum RenderPassEvent { BeforeRenderingPostProcessing = 550 }
    [System.Flags] public enum ScriptableRenderPassInput { None = 0, Depth = 1 }

    public abstract class ScriptableRenderer
    {
#if SPLATBUS_URP_HANDLES
        public RTHandle cameraColorTargetHandle { get { return null; } }
#else
        public RenderTargetIdentifier cameraColorTarget { get { return new RenderTargetIdentifier(); } }
#endif
        public void EnqueuePass(ScriptableRenderPass pass) { }
    }

    public struct CameraData
    {
        public Camera camera;
        public ScriptableRenderer renderer;
        public RenderTextureDescriptor cameraTargetDescriptor;
    }

    public struct RenderingData { public CameraData cameraData; }

    public abstract class ScriptableRenderPass
    {
        public RenderPassEvent renderPassEvent { get; set; }
        public void ConfigureInput(ScriptableRenderPassInput passInput) { }
        public abstract void Execute(ScriptableRenderContext context, ref RenderingData renderingData);
    }

    public abstract class ScriptableRendererFeature : ScriptableObject
    {
        public abstract void Create();
        public abstract void AddRenderPasses(ScriptableRenderer renderer, ref RenderingData renderingData);
    }
}
