// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    using System;
    using System.Collections.Generic;
    using UnityEngine;
    using UnityEngine.Rendering;
    using Camera = UnityEngine.Camera;
    using Object = UnityEngine.Object;
    using Pose = SplatBus.Pose;

    /// <summary>
    /// Shows through its camera what a SplatBus server renders: the camera's transform and lens steer the
    /// server, its images are laid over and under the scene by depth. Lives in play mode.
    /// </summary>
    [RequireComponent(typeof(Camera))]
    [DisallowMultipleComponent]
    [DefaultExecutionOrder(1000)] // after what moves the camera
    [AddComponentMenu("SplatBus/SplatBus View")]
    public sealed class SplatBusView : MonoBehaviour
    {
        const string ShaderName = "Hidden/SplatBus/Composite";
        const int FramesToDraw = 30;

        [Tooltip("Empty: SPLATBUS_HOST, or 127.0.0.1.")]
        public string host = "";
        [Tooltip("0: SPLATBUS_IPC_PORT, or 6001.")]
        public int ipcPort;
        [Tooltip("0: SPLATBUS_MSG_PORT, or 6000.")]
        public int messagePort;
        [Tooltip("Units of Unity to one of the splats' scene. 0: what the server says of metres, or 1.")]
        public float unit;
        [Tooltip("Geometry hides splats, and splats geometry. Off: splats cover all.")]
        public bool compareDepth = true;
        [Tooltip("Draw the scene as the camera of the image stood, so that both fit. Off: as the transform stands now.")]
        public bool followImage = true;
        [Tooltip("Ask the server for images as large as the camera's.")]
        public bool fitSize = true;
        [Tooltip("Objects of the splats' scene that transforms move.")]
        public SplatObject[] objects = new SplatObject[0];

        readonly News news = new News();
        readonly SizeRequests sizes = new SizeRequests();
        readonly Image image = new Image();
        readonly LensOf lensOf = new LensOf();
        SplatBusClient client;
        Camera eye;
        Material material;
        Pose sentPose;
        Intrinsics sentLens;
        bool hasSent, subscribedDepth, isAimed;
        string startProblem, cameraProblem;
        int drawnAt;

        /// <summary>Of the server, its images, and what is wrong. Makes garbage: for inspectors, not for every frame.</summary>
        public ViewStatus Status
        {
            get
            {
                var problems = new List<string>();
                ListProblems(problems);
                ClientStatus told = client != null ? client.Status : new ClientStatus();
                return new ViewStatus
                {
                    Server = told.Server,
                    Ipc = told.Ipc,
                    Message = told.Message,
                    Width = image.Width,
                    Height = image.Height,
                    Images = image.Count,
                    AgeSeconds = image.IsThere ? Time.realtimeSinceStartupAsDouble - image.TakenAt : double.PositiveInfinity,
                    Problems = problems.ToArray(),
                };
            }
        }

        /// <summary>The client, for what this component does not do: the scene, its time, telemetry; null while disabled.</summary>
        public SplatBusClient Client { get { return client; } }

        /// <summary>For who draws the image now: what to draw it with, or null where there is none.</summary>
        public Material Drawn()
        {
            drawnAt = Time.frameCount;
            return image.IsThere ? material : null;
        }

        void OnEnable()
        {
            eye = GetComponent<Camera>();
            eye.depthTextureMode |= DepthTextureMode.Depth;
            Shader shader = Shader.Find(ShaderName);
            if (shader != null && shader.isSupported) material = new Material(shader);
            foreach (SplatObject each in objects) each.Forget();
            news.Forget();
            sizes.Forget();
            hasSent = false;
            startProblem = cameraProblem = null;
            drawnAt = Time.frameCount;
            try
            {
                client = new SplatBusClient(Options());
                Subscribe();
            }
            catch (ArgumentException wrong)
            {
                startProblem = wrong.Message;
                Debug.LogWarning("SplatBus: " + startProblem, this);
            }
        }

        void OnDisable()
        {
            if (client != null) client.Dispose();
            client = null;
            Aim(false);
            image.Destroy();
            if (material != null) Object.Destroy(material);
            material = null;
        }

        void LateUpdate()
        {
            if (client == null) return;
            HearNews();
            if (subscribedDepth != compareDepth) Subscribe();
            double now = Time.realtimeSinceStartupAsDouble;
            bool asks = fitSize && news.Has(Capability.Viewport);
            sizes.Turn(client, asks, eye.pixelWidth, eye.pixelHeight, now);
            float sceneUnit = SceneUnit(news.Images);
            SendCamera(sceneUnit);
            foreach (SplatObject each in objects) each.Send(client, sceneUnit);
            TakeImage(now);
            Aim(followImage && image.IsThere);
        }

        /// <summary>The built-in pipeline calls this; under URP, <c>SplatBusFeature</c> draws.</summary>
        void OnRenderImage(RenderTexture source, RenderTexture target)
        {
            Material now = Drawn();
            if (now != null) Graphics.Blit(source, target, now);
            else Graphics.Blit(source, target);
        }

        /// <summary>The token comes from the environment alone: a scene is kept with the sources, and shipped in the player.</summary>
        ClientOptions Options()
        {
            ClientOptions options = ClientOptions.FromEnvironment();
            options.Name = "splatbus-unity";
            if (!string.IsNullOrEmpty(host)) options.Host = host;
            if (ipcPort != 0) options.IpcPort = Port(ipcPort);
            if (messagePort != 0) options.MessagePort = Port(messagePort);
            return options;
        }

        static int Port(int port)
        {
            if (port < 1 || port > 65535) throw new ArgumentException("the port " + port + " is none from 1 to 65535");
            return port;
        }

        /// <summary>Have depth sent only where it is used.</summary>
        void Subscribe()
        {
            subscribedDepth = compareDepth;
            client.Subscribe(true, compareDepth);
            if (image.IsThere) image.Set(material, compareDepth);
        }

        void HearNews()
        {
            NewsKind heard = news.Take(client, this);
            if ((heard & NewsKind.Lost) != 0 || news.Images == null) image.Forget();
            if ((heard & NewsKind.Images) != 0) sizes.ImagesAre(news.Images);
            if ((heard & NewsKind.Asked) != 0) sizes.AskAgain();
        }

        float SceneUnit(InitPacket packet)
        {
            if (unit > 0) return unit;
            double? metres = packet != null ? packet.Semantics.UnitMetres : null;
            return metres.HasValue ? (float)metres.Value : 1;
        }

        /// <summary>Say where the camera is, if that is new.</summary>
        void SendCamera(float sceneUnit)
        {
            Pose pose = Axes.ToWire(transform.position, transform.rotation, sceneUnit);
            // Only a lens of the images' shape is taken [CAM-6], and what that is the server says meanwhile.
            bool isKnown = sizes.Width > 0 && !sizes.IsUnderWay && !eye.orthographic;
            Intrinsics lens = isKnown ? lensOf.Camera(eye, sizes.Width, sizes.Height, sceneUnit) : null;
            if (hasSent && Axes.Same(pose, sentPose) && (lens == null || lens == sentLens)) return;
            hasSent = true;
            sentPose = pose;
            sentLens = lens;
            try
            {
                client.SendCamera(pose, lens);
                cameraProblem = null;
            }
            catch (ArgumentException wrong) { cameraProblem = "the camera cannot be sent: " + wrong.Message; }
        }

        void TakeImage(double now)
        {
            if (material == null) return;
            using (FrameLease lease = client.TakeFrame())
                if (lease.IsThere && image.Take(lease, SceneUnit(lease.Packet), now)) image.Set(material, compareDepth);
            if (image.IsThere && image.Shows(sentPose)) news.IsFollowed();
        }

        void Aim(bool atImage)
        {
            if (atImage)
            {
                eye.worldToCameraMatrix = image.WorldToCamera();
                eye.projectionMatrix = image.Projection(eye.nearClipPlane, eye.farClipPlane);
            }
            else if (isAimed)
            {
                eye.ResetWorldToCameraMatrix();
                eye.ResetProjectionMatrix();
            }
            isAimed = atImage;
        }

        void ListProblems(List<string> to)
        {
            if (startProblem != null) to.Add(startProblem);
            if (client == null) return;
            if (material == null) to.Add("the shader " + ShaderName + " is missing, or this GPU does not support it");
            if (eye.orthographic) to.Add("the camera is orthographic: splats are seen through a perspective lens only");
            if (cameraProblem != null) to.Add(cameraProblem);
            news.ListProblems(to);
            if (image.Problem != null) to.Add(image.Problem);
            if (sizes.Problem != null) to.Add(sizes.Problem);
            foreach (SplatObject each in objects)
            {
                if (each.Problem != null) to.Add(each.Problem);
                else if (news.IsKnown && !news.Has(Capability.Objects) && each.IsMany) to.Add("the server moves the object \"default\" alone, at scale 1");
            }
            if (image.IsThere && Time.frameCount > drawnAt + FramesToDraw)
                to.Add(GraphicsSettings.currentRenderPipeline != null ? "nothing draws the images: the renderer of the pipeline has no SplatBus Feature" : "nothing draws the images: the camera does not render");
        }
    }
}
