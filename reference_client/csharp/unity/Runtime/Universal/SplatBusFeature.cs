// SPDX-License-Identifier: MIT
namespace SplatBus.Unity.Universal
{
    using UnityEngine;
    using UnityEngine.Rendering;
    using UnityEngine.Rendering.Universal;

    /// <summary>Draws the images of <see cref="SplatBusView"/> under URP: add it to the renderer that the camera uses.</summary>
    public sealed class SplatBusFeature : ScriptableRendererFeature
    {
        [Tooltip("When splats are laid over the scene; what is drawn later covers them.")]
        public RenderPassEvent when = RenderPassEvent.BeforeRenderingPostProcessing;

        CompositePass pass;

        public override void Create() { pass = new CompositePass { renderPassEvent = when }; }

        public override void AddRenderPasses(ScriptableRenderer renderer, ref RenderingData renderingData)
        {
            SplatBusView view;
            if (!renderingData.cameraData.camera.TryGetComponent(out view) || !view.isActiveAndEnabled) return;
            pass.Material = view.Drawn();
            if (pass.Material != null) renderer.EnqueuePass(pass);
        }

        /// <summary>Scene and splats into a texture of their own, and back.</summary>
        sealed class CompositePass : ScriptableRenderPass
        {
            static readonly int BothId = Shader.PropertyToID("_SplatBusBoth");

            internal Material Material;

            internal CompositePass() { ConfigureInput(ScriptableRenderPassInput.Depth); }

            public override void Execute(ScriptableRenderContext context, ref RenderingData renderingData)
            {
                RenderTextureDescriptor form = renderingData.cameraData.cameraTargetDescriptor;
                form.depthBufferBits = 0;
                form.msaaSamples = 1;
#if SPLATBUS_URP_HANDLES
                RenderTargetIdentifier scene = renderingData.cameraData.renderer.cameraColorTargetHandle;
#else
                RenderTargetIdentifier scene = renderingData.cameraData.renderer.cameraColorTarget;
#endif
                CommandBuffer commands = CommandBufferPool.Get("SplatBus");
                commands.GetTemporaryRT(BothId, form, FilterMode.Point);
                commands.Blit(scene, BothId, Material, 0);
                commands.Blit(BothId, scene);
                commands.ReleaseTemporaryRT(BothId);
                context.ExecuteCommandBuffer(commands);
                CommandBufferPool.Release(commands);
            }
        }
    }
}
