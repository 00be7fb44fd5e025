// SPDX-License-Identifier: MIT
using System;

namespace SplatBus.Tests
{
    /// <summary>The whole client in a frame loop, both of its threads: how often the garbage collector runs.</summary>
    static class FrameLoop
    {
        const int WarmUp = 500;
        static readonly TimeSpan Patience = TimeSpan.FromSeconds(20);

        /// <summary>Read so many images from the server that the environment names, and answer each with a pose.</summary>
        internal static int Run(int frames)
        {
            using (var client = new SplatBusClient(ClientOptions.FromEnvironment()))
            {
                float sum = Read(client, WarmUp);
                int before = GC.CollectionCount(0);
                sum += Read(client, frames);
                Console.WriteLine("{0} frames, {1} collections, {2} in sum", frames, GC.CollectionCount(0) - before, sum);
                return 0;
            }
        }

        static float Read(SplatBusClient client, int frames)
        {
            float sum = 0;
            Pose pose = Pose.Identity;
            for (int i = 0; i < frames; i++)
                using (FrameLease lease = client.TakeFrame(Patience))
                {
                    if (!lease.IsThere) throw new TimeoutException("no further image, but " + i + ": " + client.Status.Problem);
                    sum += lease.Color[0] + lease.Depth[0];
                    pose.X = lease.Frame.Camera.Position[0] + 0.1 * i;
                    client.SendCamera(pose);
                }
            return sum;
        }
    }
}
